// The step itself, compiled once a path.
#pragma once

#include "frame.hpp"
#include "lanes.hpp"

namespace PATH {
namespace {

using namespace surfsup;

// sums[row][column] = sum over k of a[row][k] * w[k][column], for HEIGHT rows and VECTORS vectors of columns.
template <int HEIGHT, int VECTORS>
inline void multiply(const float* a, int64_t a_row, int depth, const float* w, int64_t w_row, Floats (&sums)[HEIGHT][VECTORS]) {
#pragma GCC unroll 12
    for (int row = 0; row < HEIGHT; ++row)
#pragma GCC unroll 3
        for (int v = 0; v < VECTORS; ++v) sums[row][v] = Floats{};
    for (int k = 0; k < depth; ++k) {
        Floats columns[VECTORS];
#pragma GCC unroll 3
        for (int v = 0; v < VECTORS; ++v) columns[v] = load(w + k * w_row + v * LANES);
#pragma GCC unroll 12
        for (int row = 0; row < HEIGHT; ++row) {
            const Floats value = splat(a[row * a_row + k]);
#pragma GCC unroll 3
            for (int v = 0; v < VECTORS; ++v) sums[row][v] += value * columns[v];
        }
    }
}

// The product of a block of rows, HEIGHT at a time, with `columns` columns of rows of `w_row` floats; `use` takes each
// vector of it: (row, column, values). Not inlined: among other code its sums would not stay in the registers.
template <int HEIGHT, int VECTORS, typename Use>
__attribute__((noinline)) void product_by(const float* a, int64_t a_row, int depth, const float* w, int64_t w_row, int columns, Use use) {
    for (int first = 0; first < ROWS; first += HEIGHT)
        for (int column = 0; column < columns; column += VECTORS * LANES) {
            Floats sums[HEIGHT][VECTORS];
            multiply(a + first * a_row, a_row, depth, w + column, w_row, sums);
#pragma GCC unroll 12
            for (int row = 0; row < HEIGHT; ++row)
#pragma GCC unroll 3
                for (int v = 0; v < VECTORS; ++v) use(first + row, column + v * LANES, sums[row][v]);
        }
}

template <typename Use>
inline void product(const float* a, int64_t a_row, int depth, const float* w, int64_t w_row, int columns, Use use) {
    if (columns % (2 * LANES) == 0)
        product_by<ROWS, 2>(a, a_row, depth, w, w_row, columns, use);
    else if (columns % (3 * LANES) == 0)
        product_by<ROWS / 2, 3>(a, a_row, depth, w, w_row, columns, use);
    else
        product_by<ROWS, 1>(a, a_row, depth, w, w_row, columns, use);
}

// All columns of the weights.
template <typename Use>
inline void product(const float* a, int64_t a_row, int depth, const float* w, int columns, Use use) {
    product(a, a_row, depth, w, columns, columns, use);
}

// Sums over neighbours of VECTORS vectors of what they tell, for every kernel apart, `row` floats from one neighbour, and
// from one kernel, to the next.
constexpr int GATHERED = 2;  // vectors at once

#if defined(__AVX512F__)
// Eight sums of two vectors fit the 32 registers.
template <int VECTORS>
inline void gather(const Edges& edges, const float* told, int row, float* to) {
    Floats sums[KERNELS][VECTORS];
#pragma GCC unroll 8
    for (int m = 0; m < KERNELS; ++m)
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) sums[m][v] = Floats{};
    const int64_t near = edges.near, all = edges.all;
    const float *wide = edges.kernels, *close = wide + 4 * all;
    for (int64_t e = 0; e < near; ++e) {
        const float* from = told + static_cast<int64_t>(edges.senders[e]) * row;
        Floats values[VECTORS];
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) values[v] = load(from + v * LANES);
#pragma GCC unroll 4
        for (int m = 0; m < 4; ++m) {
            const Floats of_wide = splat(wide[m * all + e]), of_close = splat(close[m * near + e]);
#pragma GCC unroll 2
            for (int v = 0; v < VECTORS; ++v) {
                sums[WIDE_KERNELS[m]][v] += of_wide * values[v];
                sums[CLOSE_KERNELS[m]][v] += of_close * values[v];
            }
        }
    }
    // Two at a time, each to sums of its own: four sums alone would wait for each other's additions.
    Floats others[4][VECTORS];
#pragma GCC unroll 4
    for (int m = 0; m < 4; ++m)
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) others[m][v] = Floats{};
    const auto add = [&](int64_t e, auto&& sum_of) {
        const float* from = told + static_cast<int64_t>(edges.senders[e]) * row;
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) {
            const Floats value = load(from + v * LANES);
#pragma GCC unroll 4
            for (int m = 0; m < 4; ++m) sum_of(m)[v] += splat(wide[m * all + e]) * value;
        }
    };
    int64_t e = near;
    for (; e + 2 <= all; e += 2) {
        add(e, [&](int m) -> Floats(&)[VECTORS] { return sums[WIDE_KERNELS[m]]; });
        add(e + 1, [&](int m) -> Floats(&)[VECTORS] { return others[m]; });
    }
    if (e < all) add(e, [&](int m) -> Floats(&)[VECTORS] { return others[m]; });
#pragma GCC unroll 4
    for (int m = 0; m < 4; ++m)
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) sums[WIDE_KERNELS[m]][v] += others[m][v];
#pragma GCC unroll 8
    for (int m = 0; m < KERNELS; ++m)
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) store(to + m * row + v * LANES, sums[m][v]);
}
#else
// Four sums of two vectors fit the 16 registers, so the two windows take turns.
template <int VECTORS>
inline void gather_window(const float* kernels, const int (&which)[4], const int32_t* senders, int64_t count,
                          const float* told, int row, float* to) {
    Floats sums[4][VECTORS];
#pragma GCC unroll 4
    for (int m = 0; m < 4; ++m)
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) sums[m][v] = Floats{};
    for (int64_t e = 0; e < count; ++e) {
        const float* from = told + static_cast<int64_t>(senders[e]) * row;
        Floats values[VECTORS];
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) values[v] = load(from + v * LANES);
#pragma GCC unroll 4
        for (int m = 0; m < 4; ++m) {
            const Floats weight = splat(kernels[m * count + e]);
#pragma GCC unroll 2
            for (int v = 0; v < VECTORS; ++v) sums[m][v] += weight * values[v];
        }
    }
#pragma GCC unroll 4
    for (int m = 0; m < 4; ++m)
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) store(to + which[m] * row + v * LANES, sums[m][v]);
}

template <int VECTORS>
inline void gather(const Edges& edges, const float* told, int row, float* to) {
    gather_window<VECTORS>(edges.kernels, WIDE_KERNELS, edges.senders, edges.all, told, row, to);
    gather_window<VECTORS>(edges.kernels + 4 * edges.all, CLOSE_KERNELS, edges.senders, edges.near, told, row, to);
}
#endif

inline int32_t wrapped(int32_t cell, int32_t size) { return cell < 0 ? cell + size : cell >= size ? cell - size : cell; }

// What a cell's place along one axis adds to its number, where `tiles` is how many tiles further one is in memory.
inline int32_t number_along(int32_t cell, int32_t tiles, int32_t cells) {
    return cell / TILE * (tiles * TILE * TILE * TILE) + cell % TILE * cells;
}

// Room for `count` places and a vector more.
inline bool make_room(Arena& arena, int64_t count, Places& places) {
    const int64_t room = (count + 2 * LANES - 1) / LANES * LANES;
    auto* memory = static_cast<float*>(take(arena, 4 * 4 * room));
    places = {memory, memory + room, memory + 2 * room, reinterpret_cast<int32_t*>(memory + 3 * room)};
    return memory != nullptr;
}

// What a thread needs to look for neighbours: all that is in the 27 cells around one, and for each row of a block those of
// it within the radius, and these again, near ones first.
struct Search {
    int32_t cell = 0;  // that was seen last, counted from one
    int64_t count = 0, room = 0;
    Places candidates{}, within[ROWS]{}, sorted[ROWS]{};
    int64_t found[ROWS]{}, near[ROWS]{}, row_room[ROWS]{};
};

// Copies what is in the cells around `cell`, filled up to whole vectors by what is infinitely far.
inline bool see_cell(const Frame& frame, int32_t cell, Search& search, Arena& arena) {
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
                // Which cells are empty cannot be foretold: without a branch, the next one takes the place.
                begin[ranges] = first, end[ranges] = last;
                ranges += first != last;
                search.count += last - first;
            }
    if (search.count > search.room || search.room == 0) {
        search.room = 2 * search.count + 1;
        if (!make_room(arena, search.room, search.candidates)) return false;
    }
    const Places& to = search.candidates;
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

// The four kernels of a window that ends at `reach`, each a list of `count` edges. Whole vectors are stored: what spills
// over a list's end is overwritten by what comes there, and behind the last list there must be room for a vector.
inline void kernels_of(const Frame& frame, const Places& edges, int64_t count, float reach, float* to) {
    const float scale = 1.0f / frame.constants.radius, to_reach = 1.0f / reach;
    // The last vector, which spills, comes first.
    for (int64_t e = (count + LANES - 1) / LANES * LANES - LANES; e >= 0; e -= LANES) {
        const Floats x = load(edges.x + e) * scale, y = load(edges.y + e) * scale, z = load(edges.z + e) * scale;
        const Floats distance = square_root(x * x + y * y + z * z);
        const Floats window = at_least(1.0f - distance * to_reach, 0.0f);
        const Floats along = window * reciprocal(at_least(distance, 1e-6f));
        store(to + e, window * window);
        store(to + count + e, along * x);
        store(to + 2 * count + e, along * y);
        store(to + 3 * count + e, along * z);
    }
}

// Finds for a row what is within `radius` of a sorted particle, among the candidates; whether there was memory.
inline bool find_within(const Frame& frame, int32_t i, float radius, int row, Search& search, Arena& arena) {
    if (search.row_room[row] < search.room) {
        search.row_room[row] = search.room;
        if (!make_room(arena, search.room, search.within[row]) || !make_room(arena, search.room, search.sorted[row]))
            return false;
    }
    const Floats px = splat(frame.x[i]), py = splat(frame.y[i]), pz = splat(frame.z[i]);
    int64_t found = 0;
    for (int64_t k = 0; k < search.count; k += LANES) {
        const Floats x = load(search.candidates.x + k) - px, y = load(search.candidates.y + k) - py;
        const Floats z = load(search.candidates.z + k) - pz;
        const Ints index = load_ints(search.candidates.index + k);
        const Ints within = (x * x + y * y + z * z <= radius * radius) & (index != i);
        found = append(search.within[row], found, within, x, y, z, index);
    }
    search.found[row] = found;
    return true;
}

// Brings what was found for a row into order, near ones first.
inline void sort_edges(const Frame& frame, int row, Search& search) {
    const float close = frame.constants.radius * frame.constants.close;
    const int64_t edges = search.found[row];
    const Places &all = search.within[row], &sorted = search.sorted[row];
    Ints lane;
#pragma GCC unroll 16
    for (int l = 0; l < LANES; ++l) lane[l] = l;
    int64_t length = 0;
    for (int which = 0; which < 2; ++which) {
        for (int64_t e = 0; e < edges; e += LANES) {
            const Floats x = load(all.x + e), y = load(all.y + e), z = load(all.z + e);
            const Ints near = x * x + y * y + z * z < close * close;
            const Ints valid = lane < static_cast<int32_t>(edges - e < LANES ? edges - e : LANES);
            length = append(sorted, length, valid & (which == 0 ? near : ~near), x, y, z, load_ints(all.index + e));
        }
        if (which == 0) search.near[row] = length;
    }
}

// The neighbours of a sorted particle, which is a row of the search, and their kernels.
inline bool keep_edges(const Frame& frame, int32_t i, int row, const Search& search, Arena& arena) {
    const Places& sorted = search.sorted[row];
    const int64_t edges = search.found[row], nears = search.near[row];
    const int64_t floats = 4 * (edges + nears);
    auto* memory = static_cast<float*>(take(arena, 4 * (floats + edges + LANES)));
    if (!memory) return false;
    auto* senders = reinterpret_cast<int32_t*>(memory + floats);
    kernels_of(frame, sorted, edges, 1.0f, memory);
    kernels_of(frame, sorted, nears, frame.constants.close, memory + 4 * edges);
    std::memcpy(senders, sorted.index, 4 * static_cast<size_t>(edges));
    frame.edges[i] = {memory, senders, static_cast<int32_t>(nears), static_cast<int32_t>(edges)};
    return true;
}

// For every kernel the sum over neighbours of (velocity, 1).
inline void sum_velocities(const Frame& frame, const Edges& edges, FourFloats (&sums)[KERNELS]) {
    for (auto& sum : sums) sum = FourFloats{};
    const int64_t near = edges.near, all = edges.all;
    const float *wide = edges.kernels, *close = wide + 4 * all;
    const auto velocity = [&](int64_t e) { return load_four(frame.velocity + 4 * static_cast<int64_t>(edges.senders[e])); };
    for (int64_t e = 0; e < all; ++e) {
        const FourFloats value = velocity(e);
        for (int m = 0; m < 4; ++m) sums[WIDE_KERNELS[m]] += wide[m * all + e] * value;
    }
    for (int64_t e = 0; e < near; ++e) {
        const FourFloats value = velocity(e);
        for (int m = 0; m < 4; ++m) sums[CLOSE_KERNELS[m]] += close[m * near + e] * value;
    }
}

// 1 at contact, 0 from the reach on, at most 2 inside; NaN stays NaN.
inline float nearness(const Frame& frame, float distance) {
    const float value = 1.0f - distance * (1.0f / frame.constants.reach);
    return value < 0.0f ? 0.0f : value > 2.0f ? 2.0f : value;
}

// What acts on a sorted particle (ROW), its soft limit still to be taken, and how its neighbours lie (8); the order is that of `columns` in network.hpp.
inline void observe(const Frame& frame, int32_t i, float* acts, float* lie) {
    const Constants& c = frame.constants;
    const int64_t caller = frame.order[i];
    const float *velocity = frame.velocities + 3 * caller, *ahead = frame.ahead + 3 * caller;
    const float* normal = frame.normal + 3 * caller;
    FourFloats sums[KERNELS];
    sum_velocities(frame, frame.edges[i], sums);
    for (int m = 0; m < KERNELS; ++m) {
        lie[m] = sums[m][3];
        for (int axis = 0; axis < 3; ++axis)
            acts[3 * m + axis] = (sums[m][axis] - lie[m] * velocity[axis]) * (c.frame_time / c.displacement_scale);
    }
    for (int column = LIMITED; column < LIMITED_ROOM; ++column) acts[column] = 0.0f;

    float* rest = acts + LIMITED_ROOM;
    const float near_solid = nearness(frame, frame.distance[caller]);
    const float from_solid = velocity[0] * normal[0] + velocity[1] * normal[1] + velocity[2] * normal[2];
    rest[0] = near_solid;
    for (int axis = 0; axis < 3; ++axis) rest[1 + axis] = near_solid * normal[axis];
    rest[4] = near_solid * from_solid * (1.0f / c.velocity_scale);
    for (int axis = 0; axis < 3; ++axis) {
        const float low = nearness(frame, ahead[axis] - frame.lower[axis]);
        const float high = nearness(frame, frame.upper[axis] - ahead[axis]);
        rest[5 + axis] = low;
        rest[8 + axis] = high;
        rest[11 + axis] = low * velocity[axis] * (1.0f / c.velocity_scale);
        rest[14 + axis] = high * -velocity[axis] * (1.0f / c.velocity_scale);
    }
    const float crowding = lie[1] - c.crowded < 0.0f ? 0.0f : lie[1] - c.crowded;
    rest[17] = crowding;
    for (int axis = 0; axis < 3; ++axis) rest[18 + axis] = crowding * lie[5 + axis];
    for (int m = 0; m < KERNELS; ++m) {
        const float most = c.thickest[m];
        lie[m] = lie[m] > most ? most : lie[m] < -most ? -most : lie[m];
    }
}

// How many particles before its turn what a particle needs is fetched: first its neighbours and their kernels, then what
// these say. Its addresses are known too late for the processor to do that by itself.
constexpr int32_t EDGES_AHEAD = 3, HIDDEN_AHEAD = 1, CALLER_AHEAD = 12;
constexpr int64_t FETCHED = 64;         // bytes
constexpr int64_t CACHED = 1024 * 1024;  // bytes of hidden states up to which they are near anyway

// GCC takes a function that only fetches for one that does nothing, and leaves out its calls; so these are none.
#define ALWAYS_INLINE inline __attribute__((always_inline))

ALWAYS_INLINE void fetch(const void* from, int64_t bytes) {
    for (int64_t at = 0; at < bytes; at += FETCHED) __builtin_prefetch(static_cast<const char*>(from) + at);
}

ALWAYS_INLINE void fetch_ahead(const Frame& frame, int32_t i, const float* told, int messages) {
    if (i + EDGES_AHEAD < frame.count) {
        const Edges& edges = frame.edges[i + EDGES_AHEAD];
        fetch(edges.kernels, 4 * (4 * (edges.all + edges.near) + edges.all));  // and behind them the neighbours
    }
    if (i + HIDDEN_AHEAD < frame.count) {
        const Edges& edges = frame.edges[i + HIDDEN_AHEAD];
        for (int32_t e = 0; e < edges.all; ++e)
            fetch(told + static_cast<int64_t>(edges.senders[e]) * messages, 4 * static_cast<int64_t>(messages));
    }
}

// The caller's particles lie in another order.
ALWAYS_INLINE void fetch_caller(const Frame& frame, int32_t i) {
    if (i + CALLER_AHEAD >= frame.count) return;
    const int64_t at = frame.order[i + CALLER_AHEAD];
    const float* const vectors[] = {frame.velocities, frame.ahead, frame.normal};
    for (const float* one : vectors) __builtin_prefetch(one + 3 * at);
    __builtin_prefetch(frame.distance + at);
}

// A vector of a particle's hidden state, and of what it tells its neighbours of it.
inline void keep_hidden(const Frame& frame, int which, int64_t i, int column, Floats values) {
    const int width = frame.weights.width, messages = frame.weights.messages;
    store(frame.hidden[which] + i * width + column, values);
    if (column < messages) store(frame.told[which] + i * messages + column, values);
}

int64_t look(const Frame& frame, int32_t begin, int32_t end, Arena& arena, float* scratch) {
    const Weights& w = frame.weights;
    const int width = w.width;
    float *acts = scratch, *lie = acts + ROWS * ROW, *one = lie + ROWS * KERNELS, *factors = one + ROWS * width;
    Search search;
    int64_t edges = 0;
    for (int32_t block = begin; block < end; block += ROWS) {
        const int here = end - block < ROWS ? end - block : ROWS;
        for (int row = 0; row < here; ++row) {
            const int32_t i = block + row, cell = frame.cells.of[i];
            fetch_caller(frame, i);
            if (cell + 1 != search.cell && !see_cell(frame, cell, search, arena)) return -1;
            if (!find_within(frame, i, frame.constants.radius, row, search, arena)) return -1;
        }
        // One thing after the other for all rows: what has only just been written piece by piece cannot be read at once.
        for (int row = 0; row < here; ++row) sort_edges(frame, row, search);
        for (int row = 0; row < here; ++row) {
            if (!keep_edges(frame, block + row, row, search, arena)) return -1;
            edges += search.found[row];
        }
        for (int row = 0; row < here; ++row) observe(frame, block + row, acts + row * ROW, lie + row * KERNELS);
        for (int row = 0; row < here; ++row)
            for (float* limited = acts + row * ROW; limited < acts + row * ROW + LIMITED_ROOM; limited += LANES)
                store(limited, soft_limit(load(limited)));
        product(lie, KERNELS, KERNELS, w.factor_in, width, [&](int row, int column, Floats sum) {
            store(one + row * width + column, silu(sum + load(w.factor_in_bias + column)));
        });
        product(one, width, width, w.factor_out, 2 * width, [&](int row, int column, Floats sum) {
            store(factors + row * 2 * width + column, 1.0f + (sum + load(w.factor_out_bias + column)));
        });
        product(acts, ROW, ROW, w.encode_in, width, [&](int row, int column, Floats sum) {
            store(one + row * width + column, silu(sum));
        });
        product(one, width, width, w.encode_out, width, [&](int row, int column, Floats sum) {
            if (row >= here) return;
            const int64_t at = static_cast<int64_t>(block + row) * width + column;
            const float* factor = factors + row * 2 * width + column;
            keep_hidden(frame, 0, block + row, column, sum * load(factor));
            store(frame.factors + at, load(factor + width));
        });
    }
    return edges;
}

// The network's answer for a sorted particle, added to ballistic motion.
inline void advance(const Frame& frame, int32_t i, float* out) {
    const Constants& c = frame.constants;
    const int64_t caller = frame.order[i];
    float velocity[3], position[3], square = 0.0f;
    for (int axis = 0; axis < 3; ++axis) {
        velocity[axis] = out[axis];
        position[axis] = c.position_share * velocity[axis] + 0.3f * out[3 + axis];
        square += velocity[axis] * velocity[axis];
    }
    const float share = square > c.largest * c.largest ? c.largest / __builtin_sqrtf(square) : 1.0f;
    for (int axis = 0; axis < 3; ++axis) {
        const int64_t at = 3 * caller + axis;
        frame.new_positions[at] = frame.ahead[at] + c.displacement_scale * share * position[axis];
        frame.new_velocities[at] = frame.velocities[at] + c.frame_time * frame.gravity[axis] +
                                   c.displacement_scale / c.frame_time * share * velocity[axis];
    }
}

void decode(const Frame& frame, int32_t block, int here, const float* hidden, float* scratch) {
    const Weights& w = frame.weights;
    const int width = w.width;
    float *scaled = scratch, *one = scaled + ROWS * width, *out = one + ROWS * width;
    for (int row = 0; row < here; ++row)
        for (int column = 0; column < width; column += LANES)
            store(scaled + row * width + column,
                  load(hidden + row * width + column) *
                      load(frame.factors + static_cast<int64_t>(block + row) * width + column));
    product(scaled, width, width, w.decode_in, width, [&](int row, int column, Floats sum) {
        store(one + row * width + column, silu(sum));
    });
    product(one, width, width, w.decode_out, OUTPUT_ROOM, [&](int row, int column, Floats sum) {
        store(out + row * OUTPUT_ROOM + column, sum);
    });
    for (int row = 0; row < here; ++row) advance(frame, block + row, out + row * OUTPUT_ROOM);
}

void layer(const Frame& frame, int number, int32_t begin, int32_t end, float* scratch) {
    const Weights& w = frame.weights;
    const int width = w.width, messages = w.messages, depth = KERNELS * messages + width;
    const float* mix = w.mix + static_cast<int64_t>(number) * depth * width;
    const float* out = w.out + static_cast<int64_t>(number) * width * width;
    const float *hidden = frame.hidden[number % 2], *told = frame.told[number % 2];
    const int next = 1 - number % 2;
    const bool last = number == w.layers - 1, fetches = static_cast<int64_t>(frame.count) * width * 4 > CACHED;
    float *sums = scratch, *one = sums + ROWS * depth, *rest = one + ROWS * width;
    for (int32_t block = begin; block < end; block += ROWS) {
        const int here = end - block < ROWS ? end - block : ROWS;
        for (int row = 0; row < here; ++row) {
            const Edges& edges = frame.edges[block + row];
            float* to = sums + static_cast<int64_t>(row) * depth;
            if (fetches) fetch_ahead(frame, block + row, told, messages);
            int column = 0;
            for (; column + GATHERED * LANES <= messages; column += GATHERED * LANES)
                gather<GATHERED>(edges, told + column, messages, to + column);
            for (; column < messages; column += LANES) gather<1>(edges, told + column, messages, to + column);
            std::memcpy(to + KERNELS * messages, hidden + static_cast<int64_t>(block + row) * width, 4 * static_cast<size_t>(width));
        }
        product(sums, depth, depth, mix, width, [&](int row, int column, Floats sum) {
            store(one + row * width + column, silu(sum));
        });
        product(one, width, width, out, width, [&](int row, int column, Floats sum) {
            if (row >= here) return;
            const int64_t at = static_cast<int64_t>(block + row) * width + column;
            keep_hidden(frame, next, block + row, column, load(hidden + at) + sum);
        });
        if (last) decode(frame, block, here, frame.hidden[next] + static_cast<int64_t>(block) * width, rest);
    }
}

int64_t scratch(const Frame& frame) {
    const int64_t width = frame.weights.width;
    const int64_t to_look = ROW + KERNELS + 3 * width, to_layer = KERNELS * frame.weights.messages + (1 + 1 + 2) * width + OUTPUT_ROOM;
    return ROWS * (to_look > to_layer ? to_look : to_layer);
}

}  // namespace
}  // namespace PATH
