// A whole frame of a rollout: the network's step, and what every frame has besides.
#pragma once

#include <cstdint>

#include "sph/collision.hpp"
#include "sph/solver.hpp"

namespace surfsup {

// From where each particle looked at the solid last (count, 3), and how far that was off it (count), meters.
struct LastLook {
    float *places, *distance;
};

// What a frame leaves: (count, 3), (count, 3), (count).
struct Reached {
    float *positions, *velocities;
    bool* moved;
};

struct Outcome {
    int64_t edges;  // as of Network::step
    bool done;      // false where more energy was gained than may be, so that this and the guard are the caller's
};

// Free fall, the look at the solid, the step, the account of energy and, unless `guarded` is false, the guard. Of `fluid`
// the ballistic places and what is told of the solid there are made here.
Outcome next_frame(Network& network, Fluid fluid, const Ask& solid, const Clearance& clearance, bool guarded,
                   double most_gain, const LastLook& last, const Reached& reached, const Isa& isa, int threads, int64_t most_edges);

}  // namespace surfsup
