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
            const Floats weight = splat(edges.kernels[m * count + e]);
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
    Places candidates{}, within[ROWS]{};
    int64_t found[ROWS]{}, row_room[ROWS]{};
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

// The four kernels of convolution.py, each a list of `count` edges. Whole vectors are stored: what spills over a list's end
// is overwritten by what comes there, and behind the last list there must be room for a vector.
inline void kernels_of(const Frame& frame, const Places& edges, int64_t count, float* to) {
    const float scale = 1.0f / frame.constants.radius;
    // The last vector, which spills, comes first.
    for (int64_t e = (count - 1) / LANES * LANES; e >= 0; e -= LANES) {
        const Floats x = load(edges.x + e) * scale, y = load(edges.y + e) * scale, z = load(edges.z + e) * scale;
        const Floats distance = square_root(x * x + y * y + z * z);
        const Floats whole = at_least(1.0f - distance, 0.0f), inner = at_least(0.5f - distance, 0.0f);
        const Floats of_whole = whole * whole, of_inner = 4.0f * inner * inner;
        const Floats along = 3.0f * (of_whole - of_inner) * reciprocal(at_least(distance, 1e-6f));
        store(to + e, 2.0f * (of_whole * whole - of_inner * inner));
        store(to + count + e, along * x);
        store(to + 2 * count + e, along * y);
        store(to + 3 * count + e, along * z);
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

// The neighbours of a sorted particle, which is a row of the search, and their kernels.
inline bool keep_edges(const Frame& frame, int32_t i, int row, Search& search, Arena& arena) {
    const Places& within = search.within[row];
    const int64_t edges = search.found[row];
    auto* memory = static_cast<float*>(take(arena, 4 * ((KERNELS + 1) * edges + LANES)));
    if (!memory) return false;
    auto* senders = reinterpret_cast<int32_t*>(memory + KERNELS * edges);
    kernels_of(frame, within, edges, memory);
    std::memcpy(senders, within.index, 4 * static_cast<size_t>(edges));
    frame.edges[i] = {memory, senders, static_cast<int32_t>(edges)};
    return true;
}

// The four sums over neighbours of (velocity, 1), and that of the squared slopes.
inline float sum_velocities(const Frame& frame, const Edges& edges, FourFloats* sums) {
    float squares = 0.0f;
    const int64_t count = edges.count;
    for (int64_t e = 0; e < count; ++e) {
        const FourFloats value = load_four(frame.velocity + 4 * static_cast<int64_t>(edges.senders[e]));
        for (int m = 0; m < KERNELS; ++m) {
            const float kernel = edges.kernels[m * count + e];
            sums[m] += kernel * value;
            if (m > 0) squares += kernel * kernel;
        }
    }
    return squares;
}

// What a flat solid at a distance adds to density, and minus its slope a support radius; NaN stays NaN.
inline void add_solid(const SolidDensity& solids, float distance, float& density, float& slope) {
    slope = 0.0f;
    const float place = (distance - solids.deepest) * (1.0f / solids.step);
    if (place >= static_cast<float>(solids.entries - 1)) return;
    const float at = place < 0.0f ? 0.0f : place;
    const int low = at == at ? static_cast<int>(at) : 0;
    const float part = at - static_cast<float>(low);
    density += solids.density[low] * (1.0f - part) + solids.density[low + 1] * part;
    slope = solids.slope[low] * (1.0f - part) + solids.slope[low + 1] * part;
}

// 1 at contact, 0 from the reach on, at most 2 inside; NaN stays NaN.
inline float nearness(const Frame& frame, float distance) {
    const float value = 1.0f - distance * (1.0f / frame.constants.reach);
    return value < 0.0f ? 0.0f : value > 2.0f ? 2.0f : value;
}

// What solid and walls add to density at a place, and its slope a metre, as in sweeps.py.
inline float of_solids(const Frame& frame, int64_t caller, const float* place, float* slope) {
    const float* normal = frame.normal + 3 * caller;
    const float *from = frame.positions + 3 * caller, *ahead = frame.ahead + 3 * caller;
    float away = 0.0f, back = 0.0f, density = 0.0f, of_solid;
    for (int axis = 0; axis < 3; ++axis) {
        const float halfway = 0.5f * (from[axis] + ahead[axis]);
        back += (halfway - ahead[axis]) * normal[axis];
        away += (place[axis] - halfway) * normal[axis];
    }
    add_solid(frame.solids, frame.distance[caller] + back + away, density, of_solid);
    for (int axis = 0; axis < 3; ++axis) {
        float of_lower, of_upper;
        add_solid(frame.solids, place[axis] - frame.lower[axis], density, of_lower);
        add_solid(frame.solids, frame.upper[axis] - place[axis], density, of_upper);
        slope[axis] = (of_upper - of_lower - of_solid * normal[axis]) / frame.solids.support;
    }
    return density;
}

inline float dot(const float* a, const float* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

inline float at_least_none(float value) { return value < 0.0f ? 0.0f : value; }

// What of a step's sweep takes from rising density, and all that stays the same in it.
inline void begin_step(const Frame& frame, int32_t i, int step) {
    const Constants& c = frame.constants;
    Sweep& sweep = frame.sweeps[i];
    const int64_t caller = frame.order[i];
    const float *velocity = frame.velocities + 3 * caller, *from = frame.positions + 3 * caller, *faster = frame.faster + 4 * static_cast<int64_t>(i);
    const float time = c.sweep_time, gone = static_cast<float>(step) * time;
    float speed[3];
    for (int axis = 0; axis < 3; ++axis) speed[axis] = velocity[axis] + gone * frame.gravity[axis] + faster[axis];
    sweep.density = sweep.fluid;
    if (sweep.near_solids) {
        float place[3], later[3], unused[3];
        for (int axis = 0; axis < 3; ++axis) {
            const float fallen = gone * frame.gravity[axis];
            place[axis] = from[axis] + gone * (velocity[axis] + 0.5f * (time * frame.gravity[axis] + fallen)) + sweep.farther[axis];
            later[axis] = place[axis] + 0.5f * time * speed[axis];
        }
        sweep.density += of_solids(frame, caller, place, unused);
        of_solids(frame, caller, later, sweep.slope_of_solids);
    }
    for (int axis = 0; axis < 3; ++axis) sweep.slope[axis] = sweep.slope_of_fluid[axis] + sweep.slope_of_solids[axis];
    const float size = dot(sweep.slope, sweep.slope) + sweep.stiffness;
    sweep.ease = size > c.least ? 1.0f / size : size != size ? size : 0.0f;
    if (step == 0) sweep.allowed = sweep.density < 1.0f ? 1.0f : sweep.density;
    frame.taken[i] = at_least_none(c.of_rise * sweep.ease * (sweep.rising + dot(sweep.slope_of_solids, speed)));
}

// Where no solid can be felt in the frame: it is farther away than a particle that something stops suddenly goes.
inline bool may_feel_solids(const Frame& frame, int64_t caller) {
    const float *velocity = frame.velocities + 3 * caller, *ahead = frame.ahead + 3 * caller;
    const float reach = frame.solids.support + frame.constants.frame_time * 2.0f * __builtin_sqrtf(dot(velocity, velocity)) + 0.03f;
    bool far = frame.distance[caller] > reach;
    for (int axis = 0; axis < 3; ++axis) far = far && ahead[axis] - frame.lower[axis] > reach && frame.upper[axis] - ahead[axis] > reach;
    return !far;
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
    float solid = 0.0f, of_solid, into_solids[3];
    add_solid(frame.solids, frame.distance[caller], solid, of_solid);
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
        float of_lower, of_upper;
        add_solid(frame.solids, to_lower, solid, of_lower);
        add_solid(frame.solids, to_upper, solid, of_upper);
        into_solids[axis] = of_upper - of_lower - of_solid * normal[axis];
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
    const float half = 0.5f * c.frame_time * rise, over = own * (1.0f + lie[0]) + half + solid - 1.0f, most = c.densest - 1.0f;
    acts[35] = (over < 0.0f ? 0.0f : over > most ? most : over) * to_density;
    acts[36] = (rise + dot(into_solids, velocity) / frame.solids.support) * c.frame_time * to_density;

    Sweep& sweep = frame.sweeps[i];
    sweep = {};
    for (int axis = 0; axis < 3; ++axis) sweep.slope_of_fluid[axis] = scale * lie[1 + axis];
    sweep.stiffness = scale * scale * squares;
    sweep.rise = sweep.rising = rise;
    sweep.fluid = own * (1.0f + lie[0]) - half;
    sweep.near_solids = may_feel_solids(frame, caller);
    store(frame.faster + 4 * static_cast<int64_t>(i), FourFloats{});
    begin_step(frame, i, 0);
    for (int m = 0; m < SURROUNDINGS; ++m) {
        const float thickest = c.thickest[m];
        lie[m] = lie[m] > thickest ? thickest : lie[m] < -thickest ? -thickest : lie[m];
    }
}

// Velocities by the pressures of all.
void push(const Frame& frame, bool last_of_step, int32_t begin, int32_t end) {
    const Constants& c = frame.constants;
    const float scale = 2.0f * c.own_density / c.radius;
    for (int32_t i = begin; i < end; ++i) {
        const Edges& edges = frame.edges[i];
        const int64_t count = edges.count;
        const float* kernels = edges.kernels;
        float x = 0.0f, y = 0.0f, z = 0.0f;
        for (int64_t e = 0; e < count; ++e) {
            const float taken = frame.taken[edges.senders[e]];
            x += taken * kernels[count + e];
            y += taken * kernels[2 * count + e];
            z += taken * kernels[3 * count + e];
        }
        Sweep& sweep = frame.sweeps[i];
        float* faster = frame.faster + 4 * static_cast<int64_t>(i);
        const float sums[3] = {x, y, z}, own = frame.taken[i];
        for (int axis = 0; axis < 3; ++axis) {
            faster[axis] -= own * sweep.slope[axis] + scale * sums[axis];
            if (last_of_step) sweep.farther[axis] += c.sweep_time * faster[axis];
        }
    }
}

// Pressures by the velocities of all: against what would be too dense at the step's end, or those that the next step, number
// `step`, begins with.
void press(const Frame& frame, int step, bool excess, int32_t begin, int32_t end) {
    const Constants& c = frame.constants;
    const float scale = 2.0f * c.own_density / c.radius;
    for (int32_t i = begin; i < end; ++i) {
        const Edges& edges = frame.edges[i];
        const int64_t count = edges.count;
        const float* kernels = edges.kernels;
        float x = 0.0f, y = 0.0f, z = 0.0f;
        for (int64_t e = 0; e < count; ++e) {
            const float* of_sender = frame.faster + 4 * static_cast<int64_t>(edges.senders[e]);
            x += of_sender[0] * kernels[count + e];
            y += of_sender[1] * kernels[2 * count + e];
            z += of_sender[2] * kernels[3 * count + e];
        }
        Sweep& sweep = frame.sweeps[i];
        const float* faster = frame.faster + 4 * static_cast<int64_t>(i);
        sweep.rising = sweep.rise + (dot(sweep.slope_of_fluid, faster) - scale * (x + y + z));
        if (excess) {
            const float* velocity = frame.velocities + 3 * static_cast<int64_t>(frame.order[i]);
            float speed[3];
            for (int axis = 0; axis < 3; ++axis)
                speed[axis] = velocity[axis] + static_cast<float>(step + 1) * c.sweep_time * frame.gravity[axis] + faster[axis];
            const float too_much = (sweep.density - sweep.allowed) / c.sweep_time + sweep.rising + dot(sweep.slope_of_solids, speed);
            frame.taken[i] = at_least_none(c.of_excess * sweep.ease * too_much);
        } else {
            sweep.fluid += c.sweep_time * sweep.rising;
            begin_step(frame, i, step);
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
            if (!find_within(frame, i, frame.constants.radius, row, search, arena)) return -1;
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

void encode(const Frame& frame, int32_t begin, int32_t end, float* scratch) {
    const Weights& w = frame.weights;
    const Constants& c = frame.constants;
    const int width = w.width;
    float *one = scratch, *factors = one + ROWS * width;
    for (int32_t block = begin; block < end; block += ROWS) {
        const int here = end - block < ROWS ? end - block : ROWS;
        float* acts = frame.acts + static_cast<int64_t>(block) * ACTIONS;
        const float* lie = frame.lie + static_cast<int64_t>(block) * SURROUNDINGS;
        for (int row = 0; row < here; ++row)
            for (int axis = 0; axis < 3; ++axis) {
                acts[row * ACTIONS + axis] = frame.faster[4 * static_cast<int64_t>(block + row) + axis] / c.velocity_scale;
                acts[row * ACTIONS + 3 + axis] = frame.sweeps[block + row].farther[axis] / (c.frame_time * c.velocity_scale);
            }
        product(lie, SURROUNDINGS, SURROUNDINGS, w.factor_in, width, [&](int row, int column, Floats sum) {
            store(one + row * width + column, silu(sum + load(w.factor_in_bias + column)));
        });
        product(one, width, width, w.factor_out, 2 * width, [&](int row, int column, Floats sum) {
            store(factors + row * 2 * width + column, 1.0f + (sum + load(w.factor_out_bias + column)));
        });
        product(acts, ACTIONS, ACTIONS, w.encode_in, width, [&](int row, int column, Floats sum) {
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
        const float faster = frame.faster[4 * static_cast<int64_t>(i) + axis], farther = frame.sweeps[i].farther[axis];
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
    const int64_t to_encode = 3 * width, to_layer = KERNELS * frame.weights.messages + (1 + 1 + 2) * width + OUTPUT_ROOM;
    return ROWS * (to_encode > to_layer ? to_encode : to_layer);
}

}  // namespace
}  // namespace PATH
