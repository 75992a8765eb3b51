// Particles that would pass through a solid that stands still.
#pragma once

#include <vector>

#include "sph/collision.hpp"

namespace surfsup {

// Puts each particle whose path from `before` to `positions` passes through the solid, or ends so deep in it that projection
// would move it out on the other side, back to where it entered. Only particles that move nearly as far as the clearance can do
// so, which a particle in slow water does not. Returns who was stopped.
std::vector<int32_t> stop_crossings(const SolidQuery& solid, const LastQuery* last_query, const float* before, float* positions,
                                    int32_t count, const CollisionParameters& parameters);

}  // namespace surfsup
