// The parts of collision handling that still and moving solids share.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "sph/collision.hpp"

namespace surfsup {

constexpr float MIN_SWEPT_PATH = 0.9f;  // of the clearance: a shorter path cannot lead through a solid

// Clamps a particle into the box and removes velocity that points out. Returns whether it moved; NaN counts as moved.
inline bool contain(float* position, float* velocity, const float* lower, const float* upper) {
    bool moved = false;
    for (int axis = 0; axis < 3; ++axis) {
        const float value = position[axis];
        const float inside = value < lower[axis] ? lower[axis] : value > upper[axis] ? upper[axis] : value;
        if (inside == value) continue;
        moved = true;
        if (velocity[axis] * (inside - value) < 0) velocity[axis] = 0;
        position[axis] = inside;
    }
    return moved;
}

// Moves a particle along the normal and removes velocity that points into the solid.
inline void project(float* position, float* velocity, float depth, const float* normal) {
    const float normal_velocity = velocity[0] * normal[0] + velocity[1] * normal[1] + velocity[2] * normal[2];
    const float inward = normal_velocity > 0 ? 0 : normal_velocity;
    for (int axis = 0; axis < 3; ++axis) {
        position[axis] += depth * normal[axis];
        velocity[axis] -= inward * normal[axis];
    }
}

inline float distance_between(const float* from, const float* to) {
    const float x = to[0] - from[0], y = to[1] - from[1], z = to[2] - from[2];
    return std::sqrt(x * x + y * y + z * z);
}

// Particles that may be nearer than the clearance to the solid according to their last query. NaN positions are included.
inline std::vector<int32_t> possibly_near(const float* positions, const LastQuery& last_query, int32_t count,
                                          const CollisionParameters& parameters) {
    std::vector<int32_t> near;
    for (int32_t i = 0; i < count; ++i) {
        const int64_t at = 3 * static_cast<int64_t>(i);
        if (!(parameters.lipschitz_bound * distance_between(last_query.positions + at, positions + at) <
              last_query.distance[i] - parameters.clearance))
            near.push_back(i);
    }
    return near;
}

}  // namespace surfsup
