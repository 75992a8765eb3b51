// The step itself, compiled once a path.
#pragma once

#include "frame.hpp"
#include "lanes.hpp"
#include "solid_map_path.hpp"

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

constexpr int GATHERED = 2;  // vectors of channels that are summed together: a kernel is spread over a vector once for both

// Sums over neighbours of VECTORS vectors of what they tell, for every kernel apart, `row` floats from one neighbour,
// and from one kernel, to the next.
template <int VECTORS>
inline void gather(const Edges& edges, const float* told, int row, float* to) {
    // Some neighbours at a time, each to sums of its own: four sums alone would wait for each other's additions.
    Floats sums[AT_ONCE][KERNELS][VECTORS];
#pragma GCC unroll 2
    for (int s = 0; s < AT_ONCE; ++s)
#pragma GCC unroll 4
        for (int m = 0; m < KERNELS; ++m)
#pragma GCC unroll 2
            for (int v = 0; v < VECTORS; ++v) sums[s][m][v] = Floats{};
    const int64_t count = edges.count;
    const auto add = [&](int64_t e, Floats(&to_these)[KERNELS][VECTORS]) {
        const float* from = told + static_cast<int64_t>(edges.senders[e]) * row;
        Floats values[VECTORS];
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) values[v] = load(from + v * LANES);
#pragma GCC unroll 4
        for (int m = 0; m < KERNELS; ++m) {
            const Floats weight = splat(edges.kernels[KERNELS * e + m]);
#pragma GCC unroll 2
            for (int v = 0; v < VECTORS; ++v) to_these[m][v] += weight * values[v];
        }
    };
    int64_t e = 0;
    for (; e + AT_ONCE <= count; e += AT_ONCE)
#pragma GCC unroll 2
        for (int s = 0; s < AT_ONCE; ++s) add(e + s, sums[s]);
    if (e < count) add(e, sums[0]);
#pragma GCC unroll 4
    for (int m = 0; m < KERNELS; ++m)
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) {
            Floats sum = sums[0][m][v];
#pragma GCC unroll 2
            for (int s = 1; s < AT_ONCE; ++s) sum += sums[s][m][v];
            store(to + m * row + v * LANES, sum);
        }
}

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
// it within the radius.
struct Search {
    int32_t cell = 0;  // that was seen last, counted from one
    int64_t count = 0, room = 0;
    Places candidates{}, within[ROWS]{}, nearer{};
    int64_t found[ROWS]{}, row_room[ROWS]{}, nearer_room = 0;
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

// The four kernels of convolution.py, side by side for each of `count` edges. Whole vectors of edges are stored, so there
// must be room for what spills over.
inline void kernels_of(const Frame& frame, const Places& edges, int64_t count, float* to) {
    const float scale = 1.0f / frame.constants.radius;
    for (int64_t e = 0; e < count; e += LANES) {
        const Floats x = load(edges.x + e) * scale, y = load(edges.y + e) * scale, z = load(edges.z + e) * scale;
        const Floats distance = square_root(x * x + y * y + z * z);
        const Floats whole = at_least(1.0f - distance, 0.0f), inner = at_least(0.5f - distance, 0.0f);
        const Floats of_whole = whole * whole, of_inner = 4.0f * inner * inner;
        const Floats along = 3.0f * (of_whole - of_inner) * reciprocal(at_least(distance, 1e-6f));
        store_four(to + KERNELS * e, 2.0f * (of_whole * whole - of_inner * inner), along * x, along * y, along * z);
    }
}

// Finds for a row what is within `radius` of a sorted particle, among the candidates; whether there was memory.
inline bool find_within(const Frame& frame, int32_t i, float radius, int row, Search& search, Arena& arena) {
    if (search.row_room[row] < search.room) {
        search.row_room[row] = search.room;
        if (!make_room(arena, search.room, search.within[row])) return false;
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

// The neighbours of a sorted particle, which is a row of the search.
inline bool keep_edges(const Frame& frame, int32_t i, int row, Search& search, Arena& arena) {
    const Places& within = search.within[row];
    const int64_t all = search.found[row], filled = (all + LANES - 1) / LANES * LANES;
    if (search.nearer_room < search.room) {
        search.nearer_room = search.room;
        if (!make_room(arena, search.room, search.nearer)) return false;
    }
    const float radius = frame.constants.radius;
    const Ints beyond = Ints{} + frame.count;
    int64_t near = 0;
    Ints lane;
#pragma GCC unroll 16
    for (int l = 0; l < LANES; ++l) lane[l] = l;
    for (int64_t k = 0; k < filled; k += LANES) {
        const Floats x = load(within.x + k), y = load(within.y + k), z = load(within.z + k);
        const Ints index = load_ints(within.index + k), one = lane < static_cast<int32_t>(all - k);
        near = append(search.nearer, near, (x * x + y * y + z * z <= radius * radius) & one, x, y, z, index);
        store(within.index + k, (index & one) | (beyond & ~one));
    }
    auto* memory = static_cast<float*>(take(arena, 4 * ((KERNELS + 1) * near + KERNELS * LANES)));
    auto* slopes = static_cast<float*>(take(arena, 4 * (4 + 1) * filled + 4));
    if (!memory || !slopes) return false;
    auto *senders = reinterpret_cast<int32_t*>(memory + KERNELS * near), *others = reinterpret_cast<int32_t*>(slopes + 4 * filled);
    kernels_of(frame, search.nearer, near, memory);  // what spills over is overwritten by the senders
    std::memcpy(senders, search.nearer.index, 4 * static_cast<size_t>(near));
    std::memcpy(others, within.index, 4 * static_cast<size_t>(filled));
    frame.edges[i] = {memory, senders, static_cast<int32_t>(near), static_cast<int32_t>(filled), others, slopes};
    return true;
}

// The four sums over neighbours of (velocity, 1), and that of the squared slopes.
inline float sum_velocities(const Frame& frame, const Edges& edges, FourFloats* sums) {
    FourFloats squares{};
    for (int64_t e = 0; e < edges.count; ++e) {
        const FourFloats value = load_four(frame.velocity + 4 * static_cast<int64_t>(edges.senders[e]));
        const FourFloats kernels = load_four(edges.kernels + KERNELS * e);
#pragma GCC unroll 4
        for (int m = 0; m < KERNELS; ++m) sums[m] += kernels[m] * value;
        squares += kernels * kernels;
    }
    return squares[1] + squares[2] + squares[3];
}

inline float dot(const float* a, const float* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// What a solid at a distance that has a share of the neighbourhood adds to density, and its rise a metre; NaN stays NaN.
inline void add_solid(const SolidDensity& solids, float distance, float share, float& density, float& rise) {
    rise = 0.0f;
    const float farther = distance + solids.offset, q = (farther < solids.nearest ? solids.nearest : farther) / solids.support;
    if (q >= 1.0f) return;
    const float whole = 1.0f - q, inner = q < 0.5f ? 0.5f - q : 0.0f, strength = solids.strength * share;
    density += strength * (2.0f * whole * whole * whole - 8.0f * inner * inner * inner);
    rise = strength * (6.0f * whole * whole - 24.0f * inner * inner) / solids.support;
}

// The share of its neighbourhood that a flat solid at a distance has; NaN stays NaN.
inline float flat_share(const SolidDensity& solids, float distance) {
    const float place = (distance - solids.deepest) * (1.0f / solids.step);
    if (place >= static_cast<float>(solids.entries - 1)) return 0.0f;
    const float at = place < 0.0f ? 0.0f : place;
    const int low = at == at ? static_cast<int>(at) : 0;
    const float part = at - static_cast<float>(low);
    return solids.share[low] * (1.0f - part) + solids.share[low + 1] * part;
}

// What the walls add to density at a place, and its slope a metre, as in walls.py.
inline void add_walls(const Frame& frame, const float* place, float& density, float* slope) {
    const SolidDensity& solids = frame.solids;
    float distance[3], rounded = 1.0f, open = 0.0f, of_sides = 0.0f, square = 0.0f, left = 1.0f, rise;
    for (int axis = 0; axis < 3; ++axis) {
        const float below = place[axis] - frame.lower[axis], above = frame.upper[axis] - place[axis], cell = frame.cell[axis];
        distance[axis] = below < above ? below : above;
        const float part = (distance[axis] < solids.closest ? solids.closest : distance[axis]) / cell;
        if (part >= 1.0f) {
            slope[axis] = 0.0f;
            continue;
        }
        const float steep = 1.0f / (part * cell);
        rounded *= part;
        open += 1.0f - part;
        of_sides += (1.0f - part) * cell;
        square += steep * steep;
        slope[axis] = below < above ? -steep : steep;
    }
    if (open == 0.0f) return;
    for (const float one : distance) left *= 1.0f - flat_share(solids, one);
    add_solid(solids, rounded * of_sides / open, 1.0f - left, density, rise);
    const float scale = rise / __builtin_sqrtf(square);
    for (int axis = 0; axis < 3; ++axis) slope[axis] *= scale;
}

// 1 at contact, 0 from the reach on, at most 2 inside; NaN stays NaN.
inline float nearness(const Frame& frame, float distance) {
    const float value = 1.0f - distance * (1.0f / frame.constants.reach);
    return value < 0.0f ? 0.0f : value > 2.0f ? 2.0f : value;
}

// What solid and walls add to density at a place, and its slope a metre, as in sweeps.py.
inline float of_solids(const Frame& frame, int64_t caller, const float* place, bool near_solid, float* slope) {
    float density = 0.0f, rise, distance, share, normal[3];
    add_walls(frame, place, density, slope);
    if (!near_solid) return density;
    if (frame.map.places) {
        look_up(frame.map, place, distance, share, normal);
    } else {
        const float* ahead = frame.ahead + 3 * caller;
        distance = frame.distance[caller];
        for (int axis = 0; axis < 3; ++axis) {
            normal[axis] = frame.normal[3 * caller + axis];
            distance += (place[axis] - ahead[axis]) * normal[axis];
        }
        share = flat_share(frame.solids, distance);
    }
    add_solid(frame.solids, distance, share, density, rise);
    for (int axis = 0; axis < 3; ++axis) slope[axis] -= rise * normal[axis];
    return density;
}

inline float at_least_none(float value) { return value < 0.0f ? 0.0f : value; }

// Whether solid and walls can be felt in the frame: no particle that something stops or throws goes farther than this from
// where ballistic motion would take it, and a map's distance is off by a few millimetres where the solid has edges.
inline void find_what_is_felt(const Frame& frame, int64_t caller, Sweep& sweep) {
    const float *velocity = frame.velocities + 3 * caller, *ahead = frame.ahead + 3 * caller;
    const float reach = frame.solids.support + 1.5f * frame.constants.frame_time * __builtin_sqrtf(dot(velocity, velocity)) + 0.01f;
    sweep.near_solid = !(frame.distance[caller] > reach);
    sweep.near_walls = false;
    for (int axis = 0; axis < 3; ++axis)
        sweep.near_walls = sweep.near_walls || !(ahead[axis] - frame.lower[axis] > reach && frame.upper[axis] - ahead[axis] > reach);
}

// What acts on a sorted particle but for the sweeps, how its neighbours lie, as in features.py, and what sweeps begin with.
inline void observe(const Frame& frame, int32_t i) {
    const Constants& c = frame.constants;
    const int64_t caller = frame.order[i];
    const float *velocity = frame.velocities + 3 * caller, *ahead = frame.ahead + 3 * caller;
    const float* normal = frame.normal + 3 * caller;
    float *acts = frame.acts + static_cast<int64_t>(i) * ACTIONS, *lie = frame.lie + static_cast<int64_t>(i) * SURROUNDINGS;
    FourFloats sums[KERNELS] = {};
    const float squares = sum_velocities(frame, frame.edges[i], sums);

    const float to_velocity = 1.0f / c.velocity_scale, to_nearness = 1.0f / c.nearness_scale, to_density = 1.0f / c.density_scale;
    const float near_solid = nearness(frame, frame.distance[caller]);
    float into_solids[3];
    const float solid = of_solids(frame, caller, ahead, near_solid > 0.0f || near_solid != near_solid, into_solids);
    acts[6] = near_solid * to_nearness;
    for (int axis = 0; axis < 3; ++axis) acts[7 + axis] = near_solid * to_nearness * normal[axis];
    acts[10] = near_solid * dot(velocity, normal) * to_velocity;
    for (int axis = 0; axis < 3; ++axis) {
        const float to_lower = ahead[axis] - frame.lower[axis], to_upper = frame.upper[axis] - ahead[axis];
        const float low = nearness(frame, to_lower), high = nearness(frame, to_upper);
        acts[11 + axis] = low * to_nearness;
        acts[14 + axis] = high * to_nearness;
        acts[17 + axis] = low * velocity[axis] * to_velocity;
        acts[20 + axis] = high * -velocity[axis] * to_velocity;
    }
    for (int m = 0; m < KERNELS; ++m) {
        lie[m] = sums[m][3];
        for (int axis = 0; axis < 3; ++axis) acts[23 + 3 * m + axis] = (sums[m][axis] - lie[m] * velocity[axis]) * to_velocity;
    }
    lie[4] = squares;
    lie[5] = solid;

    const float own = c.own_density, scale = 2.0f * own / c.radius;
    float rise = 0.0f;
    for (int axis = 0; axis < 3; ++axis) rise -= sums[1 + axis][axis] - lie[1 + axis] * velocity[axis];
    rise *= scale;
    const float over = own * (1.0f + lie[0]) + 0.5f * c.frame_time * rise + solid - 1.0f, most = c.densest - 1.0f;
    acts[35] = (over < 0.0f ? 0.0f : over > most ? most : over) * to_density;
    acts[36] = (rise + dot(into_solids, velocity)) * c.frame_time * to_density;

    frame.sweeps[i] = {};
    find_what_is_felt(frame, caller, frame.sweeps[i]);
    for (int m = 0; m < SURROUNDINGS; ++m) {
        const float thickest = c.thickest[m];
        lie[m] = lie[m] > thickest ? thickest : lie[m] < -thickest ? -thickest : lie[m];
    }
}

// Density at the places of a step, and the pressures against its rise.
void approach(const Frame& frame, int step, int32_t begin, int32_t end) {
    const Constants& c = frame.constants;
    const float scale = 2.0f * c.own_density / c.radius, shrink = 1.0f / c.radius, fallen = static_cast<float>(step) * c.step_time;
    for (int32_t i = begin; i < end; ++i) {
        const Edges& edges = frame.edges[i];
        const float *place = frame.place + 4 * static_cast<int64_t>(i), *speed = frame.speed + 4 * static_cast<int64_t>(i);
        Floats window{}, slope_x{}, slope_y{}, slope_z{}, parting{}, squares{};
        for (int32_t e = 0; e < edges.all_count; e += LANES) {
            Floats x, y, z, vx, vy, vz;
            pick_three(frame.place, edges.all + e, x, y, z);
            pick_three(frame.speed, edges.all + e, vx, vy, vz);
            x = (x - place[0]) * shrink, y = (y - place[1]) * shrink, z = (z - place[2]) * shrink;
            const Floats square = x * x + y * y + z * z, distance = square_root(square);
            const Floats whole = at_least(1.0f - distance, 0.0f), inner = at_least(0.5f - distance, 0.0f);
            const Floats of_whole = whole * whole, of_inner = 4.0f * inner * inner;
            const Floats along = 3.0f * (of_whole - of_inner) * reciprocal(at_least(distance, 1e-6f));
            const Floats fx = along * x, fy = along * y, fz = along * z;
            float* slopes = edges.slopes + 4 * e;
            store(slopes, fx);
            store(slopes + LANES, fy);
            store(slopes + 2 * LANES, fz);
            store(slopes + 3 * LANES, along * reciprocal(at_least(along * along * (square + c.softened), 1e-30f)));
            window += 2.0f * (of_whole * whole - of_inner * inner);
            slope_x += fx, slope_y += fy, slope_z += fz;
            parting += fx * (vx - speed[0]) + fy * (vy - speed[1]) + fz * (vz - speed[2]);
            squares += fx * fx + fy * fy + fz * fz;
        }
        Sweep& sweep = frame.sweeps[i];
        float density = c.own_density * (1.0f + sum(window)), rise = -scale * sum(parting);
        const float fluid[3] = {scale * sum(slope_x), scale * sum(slope_y), scale * sum(slope_z)};
        if (sweep.near_solid || sweep.near_walls) {
            density += of_solids(frame, frame.order[i], place, sweep.near_solid, sweep.slope_of_solids);
            for (int axis = 0; axis < 3; ++axis) rise += sweep.slope_of_solids[axis] * (speed[axis] + fallen * frame.gravity[axis]);
        }
        for (int axis = 0; axis < 3; ++axis) sweep.slope[axis] = fluid[axis] + sweep.slope_of_solids[axis];
        const float size = dot(sweep.slope, sweep.slope) + scale * scale * sum(squares);
        sweep.ease = size > c.least ? 1.0f / size : size != size ? size : 0.0f;
        if (step == 0) {
            const bool beside = !frame.map.places && frame.distance[frame.order[i]] < frame.solids.support;
            sweep.allowed = beside && density > 1.0f ? density : 1.0f;
        }
        const float too_dense = density - sweep.allowed;
        sweep.too_dense = too_dense > c.most_dense ? c.most_dense : too_dense;
        frame.lightness[i] = 1.0f / density;
        frame.taken[i] = at_least_none(c.of_rise * sweep.ease * rise);
    }
}

// What pressures take from a particle's speed: its own, and its neighbours'.
inline void take_pressures(const Frame& frame, int32_t i, float* speed) {
    const Edges& edges = frame.edges[i];
    Floats x{}, y{}, z{};
    for (int32_t e = 0; e < edges.all_count; e += LANES) {
        const Floats taken = pick(frame.taken, load_ints(edges.all + e));
        const float* slopes = edges.slopes + 4 * e;
        x += taken * load(slopes);
        y += taken * load(slopes + LANES);
        z += taken * load(slopes + 2 * LANES);
    }
    const float scale = 2.0f * frame.constants.own_density / frame.constants.radius, own = frame.taken[i];
    const float *slope = frame.sweeps[i].slope, sums[3] = {sum(x), sum(y), sum(z)};
    for (int axis = 0; axis < 3; ++axis) speed[axis] -= own * slope[axis] + scale * sums[axis];
}

void push(const Frame& frame, int32_t begin, int32_t end) {
    for (int32_t i = begin; i < end; ++i) {
        float *speed = frame.speed + 4 * static_cast<int64_t>(i), *faster = frame.sweeps[i].faster;
        const float* velocity = frame.velocity + 4 * static_cast<int64_t>(i);
        take_pressures(frame, i, faster);
        for (int axis = 0; axis < 3; ++axis) speed[axis] = velocity[axis] + faster[axis];
    }
}

// Viscosity, and the pressures against what would be too dense at the step's end.
void press(const Frame& frame, int step, int32_t begin, int32_t end) {
    const Constants& c = frame.constants;
    const float scale = 2.0f * c.own_density / c.radius, fallen = static_cast<float>(step + 1) * c.step_time;
    for (int32_t i = begin; i < end; ++i) {
        const Edges& edges = frame.edges[i];
        const float* speed = frame.speed + 4 * static_cast<int64_t>(i);
        Floats parting{}, drag_x{}, drag_y{}, drag_z{};
        for (int32_t e = 0; e < edges.all_count; e += LANES) {
            Floats vx, vy, vz;
            pick_three(frame.speed, edges.all + e, vx, vy, vz);
            const float* slopes = edges.slopes + 4 * e;
            const Floats fx = load(slopes), fy = load(slopes + LANES), fz = load(slopes + 2 * LANES);
            const Floats along = fx * (vx - speed[0]) + fy * (vy - speed[1]) + fz * (vz - speed[2]);
            const Floats each = along * load(slopes + 3 * LANES) * pick(frame.lightness, load_ints(edges.all + e));
            parting += along;
            drag_x += each * fx, drag_y += each * fy, drag_z += each * fz;
        }
        Sweep& sweep = frame.sweeps[i];
        const float viscous = c.viscosity * scale / c.radius;
        sweep.drag[0] = viscous * sum(drag_x), sweep.drag[1] = viscous * sum(drag_y), sweep.drag[2] = viscous * sum(drag_z);
        float rise = -scale * sum(parting);
        if (sweep.near_solid || sweep.near_walls)
            for (int axis = 0; axis < 3; ++axis) rise += sweep.slope_of_solids[axis] * (speed[axis] + fallen * frame.gravity[axis]);
        frame.taken[i] = at_least_none(c.of_excess * sweep.ease * (sweep.too_dense / c.step_time + rise));
    }
}

// What these do, and where the next step finds the particle.
void leave(const Frame& frame, int step, int32_t begin, int32_t end) {
    const float time = frame.constants.step_time, gone = static_cast<float>(step + 1) * time;
    for (int32_t i = begin; i < end; ++i) {
        Sweep& sweep = frame.sweeps[i];
        take_pressures(frame, i, sweep.faster);
        const float* from = frame.positions + 3 * static_cast<int64_t>(frame.order[i]);
        const float* velocity = frame.velocity + 4 * static_cast<int64_t>(i);
        float *place = frame.place + 4 * static_cast<int64_t>(i), *speed = frame.speed + 4 * static_cast<int64_t>(i);
        for (int axis = 0; axis < 3; ++axis) {
            sweep.faster[axis] += time * sweep.drag[axis];
            sweep.farther[axis] += time * sweep.faster[axis];
            const float falling = 0.5f * (time + gone) * frame.gravity[axis];
            place[axis] = from[axis] + gone * (velocity[axis] + falling) + sweep.farther[axis];
            speed[axis] = velocity[axis] + sweep.faster[axis];
        }
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
        fetch(edges.kernels, 4 * (KERNELS + 1) * static_cast<int64_t>(edges.count));  // and behind them the neighbours
    }
    if (i + HIDDEN_AHEAD < frame.count) {
        const Edges& edges = frame.edges[i + HIDDEN_AHEAD];
        for (int32_t e = 0; e < edges.count; ++e)
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

int64_t look(const Frame& frame, int32_t begin, int32_t end, Arena& arena) {
    Search search;
    int64_t edges = 0;
    for (int32_t block = begin; block < end; block += ROWS) {
        const int here = end - block < ROWS ? end - block : ROWS;
        for (int row = 0; row < here; ++row) {
            const int32_t i = block + row, cell = frame.cells.of[i];
            fetch_caller(frame, i);
            if (cell + 1 != search.cell && !see_cell(frame, cell, search, arena)) return -1;
            if (!find_within(frame, i, frame.constants.around, row, search, arena)) return -1;
        }
        // One thing after the other for all rows: what has only just been written piece by piece cannot be read at once.
        for (int row = 0; row < here; ++row) {
            if (!keep_edges(frame, block + row, row, search, arena)) return -1;
            edges += search.found[row];
        }
        for (int row = 0; row < here; ++row) observe(frame, block + row);
    }
    return edges;
}

void tell(const Frame& frame, int32_t begin, int32_t end) {
    const Constants& c = frame.constants;
    for (int32_t i = begin; i < end; ++i) {
        float* acts = frame.acts + static_cast<int64_t>(i) * ACTIONS;
        for (int axis = 0; axis < 3; ++axis) {
            acts[axis] = frame.sweeps[i].faster[axis] / c.velocity_scale;
            acts[3 + axis] = frame.sweeps[i].farther[axis] / (c.frame_time * c.velocity_scale);
        }
    }
}

void encode(const Frame& frame, int32_t begin, int32_t end, float* scratch) {
    const Weights& w = frame.weights;
    const int width = w.width, inner = w.inner;
    float *one = scratch, *factors = one + ROWS * inner;
    for (int32_t block = begin; block < end; block += ROWS) {
        const int here = end - block < ROWS ? end - block : ROWS;
        const float* acts = frame.acts + static_cast<int64_t>(block) * ACTIONS;
        const float* lie = frame.lie + static_cast<int64_t>(block) * SURROUNDINGS;
        product(lie, SURROUNDINGS, SURROUNDINGS, w.factor_in, inner, [&](int row, int column, Floats sum) {
            store(one + row * inner + column, silu(sum + load(w.factor_in_bias + column)));
        });
        product(one, inner, inner, w.factor_out, 2 * width, [&](int row, int column, Floats sum) {
            store(factors + row * 2 * width + column, 1.0f + (sum + load(w.factor_out_bias + column)));
        });
        product(acts, ACTIONS, ACTIONS, w.encoder, width, [&](int row, int column, Floats sum) {
            if (row >= here) return;
            const int64_t at = static_cast<int64_t>(block + row) * width + column;
            const float* factor = factors + row * 2 * width + column;
            keep_hidden(frame, 0, block + row, column, silu(sum) * load(factor));
            store(frame.factors + at, load(factor + width));
        });
    }
}

// The network's answer for a sorted particle, added to what the sweeps have made.
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
        const float faster = frame.sweeps[i].faster[axis], farther = frame.sweeps[i].farther[axis];
        frame.new_positions[at] = frame.ahead[at] + farther + c.displacement_scale * share * position[axis];
        frame.new_velocities[at] = frame.velocities[at] + c.frame_time * frame.gravity[axis] + faster +
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
    const int64_t to_encode = frame.weights.inner + 2 * width, to_layer = KERNELS * frame.weights.messages + (1 + 1 + 2) * width + OUTPUT_ROOM;
    return ROWS * (to_encode > to_layer ? to_encode : to_layer);
}

}  // namespace
}  // namespace PATH
