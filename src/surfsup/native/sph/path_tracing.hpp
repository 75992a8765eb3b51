// Where the paths of particles enter a solid.
#pragma once

#include <cstdint>
#include <vector>

#include "sph/collision.hpp"

namespace surfsup {

// The path of a particle within a frame, in the frame of the solid, and how much of it is traced. It is cut at the distance
// `contact`; `cut` is the part of the path there, negative before.
struct Path {
    int32_t particle;
    float from[3], to[3], length;
    float part = 0, contact = 0, cut = -1;

    void point_at(float fraction, float* point) const {
        for (int axis = 0; axis < 3; ++axis) point[axis] = from[axis] + fraction * (to[axis] - from[axis]);
    }
};

// The paths that come as near to the solid as `touch` (meters) and as their contact: sphere tracing (J. C. Hart, "Sphere
// tracing", The Visual Computer 12, 1996). Those that begin inside are left out: projection moves their particles out.
std::vector<Path> entering_paths(const SolidQuery& solid, std::vector<Path> paths, const CollisionParameters& parameters,
                                 float touch);

}  // namespace surfsup
