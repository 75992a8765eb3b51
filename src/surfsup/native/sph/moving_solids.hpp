// Solids and walls that move during a frame.
#pragma once

#include <optional>
#include <vector>

#include "sph/boundary_map.hpp"
#include "sph/collision.hpp"
#include "sph/rigid_motion.hpp"

namespace surfsup {

// A solid in its own frame, and its motion during a frame. `last_query` is in the frame of the solid.
struct MovingSolid {
    BoundaryMapView boundary_map;
    float lower[3], upper[3];  // a box around it, meters
    SolidQuery query;
    LastQuery last_query;
    RigidMotion motion;
};

struct MovingSolids {
    std::vector<MovingSolid> solids;
    std::optional<RigidMotion> walls;

    bool any() const { return walls || !solids.empty(); }
};

// Moves particles out of all solids and walls in place and marks them in `collided` (count). A particle whose path in the frame
// of a moving solid enters the solid stops where it enters, so that none passes, however thin the solid.
// See collision.hpp for the other arguments; `frame_time` is the duration of the motions in seconds.
void resolve_moving_collisions(const float* before, float* positions, float* velocities, bool* collided, int32_t count,
                               const Container& container, const CollisionParameters& parameters, const SolidQuery& solid,
                               const LastQuery* last_query, const MovingSolids& moving, float frame_time,
                               const ImpulseSums* impulses);

}  // namespace surfsup
