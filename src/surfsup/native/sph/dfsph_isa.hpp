// The sweeps of sweeps.py, compiled once a isa.
#pragma once

#include "sph/frame.hpp"
#include "sph/kernels_isa.hpp"
#include "sph/boundary_map_isa.hpp"

namespace ISA {
namespace {

using namespace surfsup;

// Meters by which a map's distance is off where the solid has edges; what is so far away is hardly felt.
constexpr float UNEVEN = 3e-3f;

inline float at_least_none(float value) { return value < 0.0f ? 0.0f : value; }

// By how much density rises or falls faster than what is slow.
inline float fast(float rise, float slow) { return rise - (rise > slow ? slow : rise < -slow ? -slow : rise); }

inline float dot(const float* a, const float* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// What a solid at a distance that has a share of the neighborhood adds to density, and its rise a meter; NaN stays NaN.
inline void add_solid(const SolidDensity& solids, float distance, float share, float& density, float& rise) {
    rise = 0.0f;
    const float farther = distance + solids.offset, q = (farther < solids.nearest ? solids.nearest : farther) / solids.support;
    if (q >= 1.0f) return;
    const float whole = 1.0f - q, inner = q < 0.5f ? 0.5f - q : 0.0f, strength = solids.strength * share;
    density += strength * (2.0f * whole * whole * whole - 8.0f * inner * inner * inner);
    rise = strength * (6.0f * whole * whole - 24.0f * inner * inner) / solids.support;
}

// The share of its neighborhood that a flat solid at a distance has; NaN stays NaN.
inline float flat_share(const SolidDensity& solids, float distance) {
    const float place = (distance - solids.deepest) * (1.0f / solids.step);
    if (place >= static_cast<float>(solids.entries - 1)) return 0.0f;
    const float at = place < 0.0f ? 0.0f : place;
    const int low = at == at ? static_cast<int>(at) : 0;
    const float part = at - static_cast<float>(low);
    return solids.share[low] * (1.0f - part) + solids.share[low + 1] * part;
}

// What the walls add to density at a place, and its slope a meter, as in walls.py.
inline void add_walls(const Frame& frame, const float* place, float& density, float* slope) {
    const SolidDensity& solids = frame.solids;
    float distance[3], rounded = 1.0f, open = 0.0f, of_sides = 0.0f, square = 0.0f, left = 1.0f, rise;
    for (int axis = 0; axis < 3; ++axis) {
        const float below = place[axis] - frame.lower[axis], above = frame.upper[axis] - place[axis];
        distance[axis] = below < above ? below : above;
        slope[axis] = 0.0f;
    }
    if (distance[0] >= frame.cell[0] && distance[1] >= frame.cell[1] && distance[2] >= frame.cell[2]) return;
    for (int axis = 0; axis < 3; ++axis) {
        const float cell = frame.cell[axis], part = (distance[axis] < solids.closest ? solids.closest : distance[axis]) / cell;
        if (part >= 1.0f) continue;
        const float steep = 1.0f / (part * cell);
        rounded *= part;
        open += 1.0f - part;
        of_sides += (1.0f - part) * cell;
        square += steep * steep;
        slope[axis] = place[axis] - frame.lower[axis] < frame.upper[axis] - place[axis] ? -steep : steep;
    }
    if (open == 0.0f) return;
    for (const float one : distance) left *= 1.0f - flat_share(solids, one);
    add_solid(solids, rounded * of_sides / open, 1.0f - left, density, rise);
    const float scale = rise / __builtin_sqrtf(square);
    for (int axis = 0; axis < 3; ++axis) slope[axis] *= scale;
}

// What solid and walls add to density at a place, and its slope a meter, as in sweeps.py. Where the solid is known to be
// farther off than its reach, nobody asks; where it is near, it becomes known how near.
inline float of_solids(const Frame& frame, int64_t caller, const float* place, float& beyond, float* slope) {
    float density = 0.0f, rise, distance, share, normal[3];
    add_walls(frame, place, density, slope);
    if (beyond > frame.solids.support) return density;
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
    if (distance < frame.solids.support) beyond = distance - UNEVEN;  // in no cell of a map it tells nothing
    add_solid(frame.solids, distance, share, density, rise);
    for (int axis = 0; axis < 3; ++axis) slope[axis] -= rise * normal[axis];
    return density;
}

// What sweeps begin with.
inline Sweep started(const Frame& frame, int64_t caller) {
    const float *from = frame.positions + 3 * caller, *ahead = frame.ahead + 3 * caller;
    const float way[3] = {ahead[0] - from[0], ahead[1] - from[1], ahead[2] - from[2]};
    Sweep sweep{};
    sweep.solid_beyond = frame.distance[caller] - __builtin_sqrtf(dot(way, way)) - UNEVEN;
    sweep.allowed = 1.0f;
    return sweep;
}

// What neighbors add up to for a particle in a step: density and its slope, in units of the kernel and of its slope.
struct Sums {
    float window, slope[3], squares, parting, drag[3], against[3];
};

// Sums over the neighbors of sorted particle i; with what only the network asks for, or without it.
template <bool FOR_NETWORK>
inline Sums sum_neighbors(const Frame& frame, int32_t i) {
    const Constants& c = frame.constants;
    const Edges& edges = frame.edges[i];
    const float shrink = 1.0f / c.radius;
    const float *place = frame.motion + MOTION * static_cast<int64_t>(i), *speed = place + 4;
    Floats window{}, slope_x{}, slope_y{}, slope_z{}, squares{}, parting{}, drag_x{}, drag_y{}, drag_z{};
    Floats against_x{}, against_y{}, against_z{};
    for (int32_t e = 0; e < edges.filled; e += LANES) {
        Floats x, y, z, vx, vy, vz, nought;
        pick_four<MOTION>(frame.motion, edges.senders + e, x, y, z, nought);
        pick_four<MOTION>(frame.motion + 4, edges.senders + e, vx, vy, vz, nought);
        x = (x - place[0]) * shrink, y = (y - place[1]) * shrink, z = (z - place[2]) * shrink;
        vx -= speed[0], vy -= speed[1], vz -= speed[2];
        const Kernels kernels = kernels_at(x, y, z);
        store(edges.along + e, kernels.along);
        window += kernels.window;
        slope_x += kernels.along * x, slope_y += kernels.along * y, slope_z += kernels.along * z;
        squares += kernels.steep * kernels.steep;
        const Floats nearing = kernels.along * (x * vx + y * vy + z * vz);
        const Floats viscous = nearing * reciprocal(kernels.square + c.softened);
        parting += nearing;
        drag_x += viscous * x, drag_y += viscous * y, drag_z += viscous * z;
        if constexpr (FOR_NETWORK) against_x += kernels.window * vx, against_y += kernels.window * vy, against_z += kernels.window * vz;
    }
    float of[8];
    sum_each({as_eight(window), as_eight(slope_x), as_eight(slope_y), as_eight(slope_z), as_eight(squares), as_eight(parting),
              as_eight(drag_x), as_eight(drag_y)},
             of);
    Sums sums{of[0], {of[1], of[2], of[3]}, of[4], of[5], {of[6], of[7], sum(drag_z)}, {}};
    if constexpr (FOR_NETWORK) sums.against[0] = sum(against_x), sums.against[1] = sum(against_y), sums.against[2] = sum(against_z);
    return sums;
}

// What the network is told of a sorted particle but for what the sweeps have made, and how its neighbors lie: features.py.
inline void tell(const Frame& frame, int32_t i, const Sums& sums, float of_solid, const float* slope_of_solids, float too_dense, float rise) {
    const Constants& c = frame.constants;
    float *acts = frame.acts + static_cast<int64_t>(i) * ACTIONS, *lie = frame.lie + static_cast<int64_t>(i) * SURROUNDINGS;
    for (int axis = 0; axis < 3; ++axis) {
        acts[6 + axis] = slope_of_solids[axis] / c.slope_scale;
        acts[9 + axis] = sums.against[axis] / c.velocity_scale;
        lie[1 + axis] = sums.slope[axis];
    }
    acts[12] = at_least_none(too_dense) / c.density_scale;
    acts[RISE] = rise * c.frame_time / c.density_scale;
    lie[0] = sums.window;
    lie[4] = sums.squares;
    lie[5] = of_solid;
    for (int m = 0; m < SURROUNDINGS; ++m) {
        const float thickest = c.thickest[static_cast<size_t>(m)];
        lie[m] = lie[m] > thickest ? thickest : lie[m] < -thickest ? -thickest : lie[m];
    }
}

// Density at the places of a step, and the pressures against its rise and against what would be too dense at the end.
template <bool LAST>
inline void approach_in(const Frame& frame, int step, int32_t begin, int32_t end) {
    const Constants& c = frame.constants;
    const float scale = c.density_slope(), step_time = c.step_time(), fallen = static_cast<float>(step) * step_time;
    for (int32_t i = begin; i < end; ++i) {
        Sweep& sweep = frame.sweeps[i];
        const int64_t caller = frame.order[i];
        if (step == 0) sweep = started(frame, caller);
        const float *place = frame.motion + MOTION * static_cast<int64_t>(i), *speed = place + 4;
        const Sums sums = sum_neighbors<LAST>(frame, i);
        float slope_of_solids[3];
        const float of_solid = of_solids(frame, caller, place, sweep.solid_beyond, slope_of_solids);
        const float density = c.own_density * (1.0f + sums.window) + of_solid;
        float rise = -scale * sums.parting;
        for (int axis = 0; axis < 3; ++axis) {
            sweep.slope[axis] = scale * sums.slope[axis] + slope_of_solids[axis];
            sweep.drag[axis] = c.viscosity * scale / c.radius * sums.drag[axis] / density;
            rise += slope_of_solids[axis] * (speed[axis] + fallen * frame.gravity[axis]);
        }
        const float size = dot(sweep.slope, sweep.slope) + scale * scale * sums.squares;
        const float ease = size > c.least ? 1.0f / size : size != size ? size : 0.0f;
        if (step == 0 && !frame.map.places && frame.distance[caller] < frame.solids.support && density > 1.0f) sweep.allowed = density;
        const float above = density - sweep.allowed, too_dense = above > c.most_dense ? c.most_dense : above;
        const float against_rise = c.of_rise * at_least_none(rise), by_gravity = step_time * dot(slope_of_solids, frame.gravity);
        const float excess = too_dense / step_time + fast(rise - against_rise, c.slow) + by_gravity;
        float* push = frame.pushes + PUSH * static_cast<int64_t>(i);
        std::memcpy(push, place, 3 * sizeof(float));
        push[3] = ease * (against_rise + c.of_excess * at_least_none(excess));
        if constexpr (LAST) tell(frame, i, sums, of_solid, slope_of_solids, too_dense, rise);
    }
}

void approach(const Frame& frame, int step, int32_t begin, int32_t end) {
    step == frame.constants.steps - 1 ? approach_in<true>(frame, step, begin, end) : approach_in<false>(frame, step, begin, end);
}

// The speed that pressures take from a particle, its own and its neighbors'.
inline void pushed(const Frame& frame, int32_t i, float* taken) {
    const Edges& edges = frame.edges[i];
    const float *push = frame.pushes + PUSH * static_cast<int64_t>(i);
    Floats sum_x{}, sum_y{}, sum_z{};
    for (int32_t e = 0; e < edges.filled; e += LANES) {
        Floats x, y, z, pressure;
        pick_four<PUSH>(frame.pushes, edges.senders + e, x, y, z, pressure);
        pressure *= load(edges.along + e);
        sum_x += pressure * (x - push[0]), sum_y += pressure * (y - push[1]), sum_z += pressure * (z - push[2]);
    }
    const float scale = frame.constants.density_slope() / frame.constants.radius, sums[3] = {sum(sum_x), sum(sum_y), sum(sum_z)};
    for (int axis = 0; axis < 3; ++axis) taken[axis] = push[3] * frame.sweeps[i].slope[axis] + scale * sums[axis];
}

// What pressures and viscosity do to a particle's speed, and where the next step finds it.
void leave(const Frame& frame, int step, int32_t begin, int32_t end) {
    const Constants& c = frame.constants;
    const float time = c.step_time(), gone = static_cast<float>(step + 1) * time;
    const bool last = step == c.steps - 1;
    for (int32_t i = begin; i < end; ++i) {
        Sweep& sweep = frame.sweeps[i];
        float taken[3];
        pushed(frame, i, taken);
        float *place = frame.motion + MOTION * static_cast<int64_t>(i), *speed = place + 4, way = 0.0f;
        for (int axis = 0; axis < 3; ++axis) {
            const float change = time * sweep.drag[axis] - taken[axis];
            sweep.faster[axis] += change;
            sweep.farther[axis] += time * sweep.faster[axis];
            if (last) continue;  // the network sees what the last step has seen
            speed[axis] += change;
            const float step_way = time * (speed[axis] + gone * frame.gravity[axis]);
            place[axis] += step_way;
            way += step_way * step_way;
        }
        sweep.solid_beyond -= __builtin_sqrtf(way);
        if (!last) continue;
        float* acts = frame.acts + static_cast<int64_t>(i) * ACTIONS;
        for (int axis = 0; axis < 3; ++axis) {
            acts[axis] = sweep.faster[axis] / c.velocity_scale;
            acts[3 + axis] = sweep.farther[axis] / (c.frame_time * c.velocity_scale);
        }
    }
}

// The new positions and velocities: what ballistic motion, the sweeps and the network's pressures make of a frame.
void finish(const Frame& frame, int32_t begin, int32_t end) {
    const Constants& c = frame.constants;
    const float largest = c.largest * c.displacement_scale / c.frame_time;
    for (int32_t i = begin; i < end; ++i) {
        float taken[3];
        pushed(frame, i, taken);
        const float square = dot(taken, taken), share = square > largest * largest ? largest / __builtin_sqrtf(square) : 1.0f;
        const Sweep& sweep = frame.sweeps[i];
        const int64_t caller = frame.order[i];
        for (int axis = 0; axis < 3; ++axis) {
            const int64_t at = 3 * caller + axis;
            const float change = share * taken[axis];
            frame.new_positions[at] = frame.ahead[at] + (sweep.farther[axis] - c.position_share * c.frame_time * change);
            frame.new_velocities[at] = frame.velocities[at] + c.frame_time * frame.gravity[axis] + (sweep.faster[axis] - change);
        }
    }
}

}  // namespace
}  // namespace ISA
