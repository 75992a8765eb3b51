// Neighbor search in a cell list, compiled once for every instruction set.
#pragma once

#include "isa/isa.hpp"
#include "isa/lanes.hpp"

namespace ISA {
namespace {

using namespace surfsup;

inline int32_t wrapped(int32_t cell, int32_t size) { return cell < 0 ? cell + size : cell >= size ? cell - size : cell; }

// What a cell coordinate along one axis adds to the cell number; `tiles` is the distance in memory to the next tile.
inline int32_t number_along(int32_t cell, int32_t tiles, int32_t cells) {
    return cell / TILE * (tiles * TILE * TILE * TILE) + cell % TILE * cells;
}

// Positions and indices of particles, as arrays of their own.
struct Candidates {
    float *x, *y, *z;
    int32_t* index;
};

// Allocates `count` candidates and room for a vector more.
inline bool allocate(Arena& arena, int64_t count, Candidates& candidates) {
    const int64_t room = (count + 2 * LANES - 1) / LANES * LANES;
    auto* memory = static_cast<float*>(take(arena, 4 * 4 * room));
    candidates = {memory, memory + room, memory + 2 * room, reinterpret_cast<int32_t*>(memory + 3 * room)};
    return memory != nullptr;
}

// A thread's buffers: the particles of the 27 cells around one cell and, for each row of a block, those within the support.
struct Search {
    int32_t cell = 0;  // whose candidates are held, counted from one
    int64_t count = 0, room = 0;
    Candidates candidates{};
    int32_t* within[ROWS]{};
    int64_t found[ROWS]{}, row_room[ROWS]{};
};

// Copies the particles of the cells around `cell`, padded with a particle at infinity. False where memory ran out.
inline bool gather_candidates(const Frame& frame, int32_t cell, Search& search, Arena& arena) {
    const Cells& cells = frame.cells;
    const int32_t *tiles = cells.size, tile = cell / (TILE * TILE * TILE), in_tile = cell % (TILE * TILE * TILE);
    const int32_t x = tile / (tiles[1] * tiles[2]) * TILE + in_tile / (TILE * TILE);
    const int32_t y = tile / tiles[2] % tiles[1] * TILE + in_tile / TILE % TILE;
    const int32_t z = tile % tiles[2] * TILE + in_tile % TILE;
    int32_t begin[27], end[27];
    int ranges = 0;
    search.cell = cell + 1;
    search.count = 0;
    int32_t along_x[3], along_y[3], along_z[3];
    for (int d = 0; d < 3; ++d) {
        along_x[d] = number_along(wrapped(x + d - 1, TILE * tiles[0]), tiles[1] * tiles[2], TILE * TILE);
        along_y[d] = number_along(wrapped(y + d - 1, TILE * tiles[1]), tiles[2], TILE);
        along_z[d] = number_along(wrapped(z + d - 1, TILE * tiles[2]), 1, 1);
    }
    for (const int32_t at_x : along_x)
        for (const int32_t at_y : along_y)
            for (const int32_t at_z : along_z) {
                const int32_t number = at_x + at_y + at_z, first = cells.first[number], last = cells.first[number + 1];
                // Branch-free: an empty cell's range is overwritten by the next one. A branch would be mispredicted often.
                begin[ranges] = first, end[ranges] = last;
                ranges += first != last;
                search.count += last - first;
            }
    if (search.count > search.room || search.room == 0) {
        search.room = 2 * search.count + 1;
        if (!allocate(arena, search.room, search.candidates)) return false;
    }
    const Candidates& to = search.candidates;
    int64_t at = 0;
    for (int r = 0; r < ranges; ++r) {
        const int32_t size = end[r] - begin[r];
        for (int32_t k = 0; k < size; k += LANES) {
            Ints index;
#pragma GCC unroll 16
            for (int lane = 0; lane < LANES; ++lane) index[lane] = lane;
            store(to.x + at + k, load(frame.x + begin[r] + k));
            store(to.y + at + k, load(frame.y + begin[r] + k));
            store(to.z + at + k, load(frame.z + begin[r] + k));
            store(to.index + at + k, index + (begin[r] + k));
        }
        at += size;
    }
    store(to.x + at, splat(__builtin_inff()));
    return true;
}

// Selects the candidates within the support of sorted particle i into a row. False where memory ran out.
inline bool select_within(const Frame& frame, int32_t i, int row, Search& search, Arena& arena) {
    if (search.row_room[row] < search.room) {
        search.within[row] = static_cast<int32_t*>(take(arena, 4 * (search.room + LANES)));
        if (!search.within[row]) return false;
        search.row_room[row] = search.room;
    }
    const float support = frame.parameters->kernel_support;
    const Floats px = splat(frame.x[i]), py = splat(frame.y[i]), pz = splat(frame.z[i]);
    int64_t found = 0;
    for (int64_t k = 0; k < search.count; k += LANES) {
        const Floats x = load(search.candidates.x + k) - px, y = load(search.candidates.y + k) - py;
        const Floats z = load(search.candidates.z + k) - pz;
        const Ints index = load_ints(search.candidates.index + k);
        const Ints within = (x * x + y * y + z * z <= support * support) & (index != i);
        found = append(search.within[row], found, within, index);
    }
    search.found[row] = found;
    return true;
}

// Stores a row of the search as the neighbors of sorted particle i. False where memory ran out.
inline bool store_neighbors(const Frame& frame, int32_t i, int row, const Search& search, Arena& arena) {
    const int32_t* within = search.within[row];
    const int64_t count = search.found[row], padded = (count + LANES - 1) / LANES * LANES;
    auto* memory = static_cast<float*>(take(arena, 4 * (1 + 1) * padded));
    if (!memory) return false;
    auto* indices = reinterpret_cast<int32_t*>(memory);
    std::memcpy(indices, within, 4 * static_cast<size_t>(count));
    for (int64_t k = count; k < padded; ++k) indices[k] = frame.count;
    frame.neighbors[i] = {indices, memory + padded, static_cast<int32_t>(count), static_cast<int32_t>(padded)};
    return true;
}

int64_t find_neighbors(const Frame& frame, int32_t begin, int32_t end, Arena& arena, Arena& searching, void* memory) {
    auto& search = *static_cast<Search*>(memory);
    int64_t pairs = 0;
    for (int32_t block = begin; block < end; block += ROWS) {
        const int here = end - block < ROWS ? end - block : ROWS;
        for (int row = 0; row < here; ++row) {
            const int32_t i = block + row, cell = frame.cells.cell_of[i];
            if (cell + 1 != search.cell && !gather_candidates(frame, cell, search, searching)) return -1;
            if (!select_within(frame, i, row, search, searching)) return -1;
        }
        // A loop of its own: reading a row right after its piecewise stores would stall store forwarding.
        for (int row = 0; row < here; ++row) {
            if (!store_neighbors(frame, block + row, row, search, arena)) return -1;
            pairs += search.found[row];
        }
    }
    return pairs;
}

int64_t find_within(const Frame& frame, int32_t i, Arena& arena, void* memory, const int32_t*& indices) {
    auto& search = *static_cast<Search*>(memory);
    const int32_t cell = frame.cells.cell_of[i];
    if (cell + 1 != search.cell && !gather_candidates(frame, cell, search, arena)) return -1;
    if (!select_within(frame, i, 0, search, arena)) return -1;
    indices = search.within[0];
    return search.found[0];
}

}  // namespace
}  // namespace ISA
