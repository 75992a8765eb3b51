// Density of solids and walls, compiled once for every instruction set. See sph/boundary/density.py and walls.py.
#pragma once

#include "sph/boundary_map_isa.hpp"
#include "sph/frame.hpp"

namespace ISA {
namespace {

using namespace surfsup;

// Upper bound in meters of the error of an interpolated distance at edges of the solid.
constexpr float MAP_ERROR = 3e-3f;

// Adds the density of a solid with a volume fraction at a distance; `slope` is its increase towards the solid, 1/m. NaN stays
// NaN.
inline void add_solid(const SolverParameters& p, float distance, float fraction, float& density, float& slope) {
    const BoundaryParameters& b = p.boundary;
    slope = 0.0f;
    const float shifted = distance + b.distance_offset,
                q = (shifted < b.min_distance ? b.min_distance : shifted) / p.kernel_support;
    if (q >= 1.0f) return;
    const float outer = 1.0f - q, inner = q < 0.5f ? 0.5f - q : 0.0f, strength = b.strength * fraction;
    density += strength * (2.0f * outer * outer * outer - 8.0f * inner * inner * inner);
    slope = strength * (6.0f * outer * outer - 24.0f * inner * inner) / p.kernel_support;
}

// Volume fraction of a plane solid at a signed distance. NaN stays NaN.
inline float plane_fraction(const BoundaryParameters& b, float distance) {
    const int entries = static_cast<int>(b.plane_fraction.size());
    const float place = (distance - b.fraction_start) * (1.0f / b.fraction_step);
    if (place >= static_cast<float>(entries - 1)) return 0.0f;
    const float clamped = place < 0.0f ? 0.0f : place;
    const int low = clamped == clamped ? static_cast<int>(clamped) : 0;
    const float part = clamped - static_cast<float>(low);
    const float* table = b.plane_fraction.data();
    return table[low] * (1.0f - part) + table[low + 1] * part;
}

// Distance and volume fraction of the container's walls at a position, and the direction towards them, whose squared length is
// `square`. False far from all walls; `towards` is written in any case.
[[gnu::always_inline]] inline bool walls_near(const Frame& frame, const float* position, float& wall_distance, float& fraction,
                                              float* towards, float& square) {
    const SolverParameters& p = *frame.parameters;
    float distance[3], product = 1.0f, open = 0.0f, weighted_side = 0.0f, free_fraction = 1.0f;
    square = 0.0f;
    for (int axis = 0; axis < 3; ++axis) {
        const float below = position[axis] - frame.lower[axis], above = frame.upper[axis] - position[axis];
        distance[axis] = below < above ? below : above;
        towards[axis] = 0.0f;
    }
    if (distance[0] >= frame.wall_cell[0] && distance[1] >= frame.wall_cell[1] && distance[2] >= frame.wall_cell[2])
        return false;
    for (int axis = 0; axis < 3; ++axis) {
        const float cell = frame.wall_cell[axis];
        const float part =
            (distance[axis] < p.boundary.min_wall_distance ? p.boundary.min_wall_distance : distance[axis]) / cell;
        if (part >= 1.0f) continue;
        const float steep = 1.0f / (part * cell);
        product *= part;
        open += 1.0f - part;
        weighted_side += (1.0f - part) * cell;
        square += steep * steep;
        towards[axis] = position[axis] - frame.lower[axis] < frame.upper[axis] - position[axis] ? -steep : steep;
    }
    if (open == 0.0f) return false;
    for (const float d : distance) free_fraction *= 1.0f - plane_fraction(p.boundary, d);
    wall_distance = product * weighted_side / open;
    fraction = 1.0f - free_fraction;
    return true;
}

// Adds the density of the container's walls at a position and writes its gradient, 1/m.
inline void add_walls(const Frame& frame, const float* position, float& density, float* gradient) {
    float distance, fraction, square, slope;
    if (!walls_near(frame, position, distance, fraction, gradient, square)) return;
    add_solid(*frame.parameters, distance, fraction, density, slope);
    const float scale = slope / __builtin_sqrtf(square);
    for (int axis = 0; axis < 3; ++axis) gradient[axis] *= scale;
}

// Distance, volume fraction and normal of a solid that moves. False out of its reach; a NaN is in reach.
inline bool moving_solid_near(const MovingBoundary& solid, const float* position, float& distance, float& fraction,
                              float* normal) {
    float own[3], local[3];
    solid.step.place.to_own(position, own);
    for (int axis = 0; axis < 3; ++axis)
        if (own[axis] < solid.lower[axis] || own[axis] > solid.upper[axis]) return false;
    for (int axis = 0; axis < 3; ++axis) local[axis] = position[axis] - solid.step.place.translation[axis];
    interpolate(solid.boundary_map, local, distance, fraction, normal);
    return true;
}

// Adds the density of a solid that moves, its gradient, and the density rate that its motion takes away, 1/s.
inline void add_moving_solid(const SolverParameters& p, const MovingBoundary& solid, const float* position, float& density,
                             float* gradient, float& solid_rate) {
    float normal[3], velocity[3], distance, fraction, slope;
    if (!moving_solid_near(solid, position, distance, fraction, normal)) return;
    add_solid(p, distance, fraction, density, slope);
    if (slope == 0.0f) return;
    solid.step.velocity(position, velocity);
    for (int axis = 0; axis < 3; ++axis) {
        gradient[axis] -= slope * normal[axis];
        solid_rate -= slope * normal[axis] * velocity[axis];
    }
}

// Density of the walls, which may move, written like add_walls and add_moving_solid.
inline void add_walls_of_frame(const Frame& frame, const float* position, float& density, float* gradient, float& solid_rate) {
    if (!frame.moving || !frame.moving->walls) {
        add_walls(frame, position, density, gradient);
        return;
    }
    const RigidStep& walls = *frame.moving->walls;
    float own[3], own_gradient[3], velocity[3];
    walls.place.to_own(position, own);
    add_walls(frame, own, density, own_gradient);
    walls.place.rotate(own_gradient, gradient);
    walls.velocity(position, velocity);
    for (int axis = 0; axis < 3; ++axis) solid_rate += gradient[axis] * velocity[axis];
}

// Distance, volume fraction and normal of the solid that stands still. False if `min_solid_distance`, a lower bound of the
// distance, exceeds the kernel support. Updates that bound near the solid.
[[gnu::always_inline]] inline bool still_solid_near(const Frame& frame, int64_t caller, const float* position,
                                                    float& min_solid_distance, float& distance, float& fraction,
                                                    float* normal) {
    const SolverParameters& p = *frame.parameters;
    const bool solid = frame.boundary_map.cell_indices || frame.solid_normal;
    if (!solid || min_solid_distance > p.kernel_support) return false;  // a NaN distance passes
    if (frame.boundary_map.cell_indices) {
        interpolate(frame.boundary_map, position, distance, fraction, normal);
    } else {
        // Without a map the solid is the tangent plane at the point nearest to the predicted position.
        const float* predicted = frame.predicted_positions + 3 * caller;
        distance = frame.solid_distance[caller];
        for (int axis = 0; axis < 3; ++axis) {
            normal[axis] = frame.solid_normal[3 * caller + axis];
            distance += (position[axis] - predicted[axis]) * normal[axis];
        }
        fraction = plane_fraction(p.boundary, distance);
    }
    if (distance < p.kernel_support) min_solid_distance = distance - MAP_ERROR;  // outside the map the distance is unknown
    return true;
}

// Adds the density of the solid that stands still and its gradient, 1/m; `min_solid_distance` as in still_solid_near.
inline void add_still_solid(const Frame& frame, int64_t caller, const float* position, float& min_solid_distance,
                            float& density, float* gradient) {
    float slope, distance, fraction, normal[3];
    if (!still_solid_near(frame, caller, position, min_solid_distance, distance, fraction, normal)) return;
    add_solid(*frame.parameters, distance, fraction, density, slope);
    for (int axis = 0; axis < 3; ++axis) gradient[axis] -= slope * normal[axis];
}

// Density of solids and walls at a position, and its gradient, 1/m; `min_solid_distance` as in add_still_solid. With MOVING
// also the density of what moves, and in `solid_rate` the density rate that its motion takes away, 1/s.
template <bool MOVING>
inline float boundary_density(const Frame& frame, int64_t caller, const float* position, float& min_solid_distance,
                              float* gradient, float& solid_rate) {
    float density = 0.0f;
    if constexpr (MOVING) {
        add_walls_of_frame(frame, position, density, gradient, solid_rate);
        for (int32_t k = 0; k < frame.moving->solid_count; ++k)
            add_moving_solid(*frame.parameters, frame.moving->solids[k], position, density, gradient, solid_rate);
    } else {
        add_walls(frame, position, density, gradient);
    }
    add_still_solid(frame, caller, position, min_solid_distance, density, gradient);
    return density;
}

}  // namespace
}  // namespace ISA
