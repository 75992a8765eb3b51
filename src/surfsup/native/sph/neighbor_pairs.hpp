// All neighbor pairs of particles as a list, for networks and for the solver in torch.
#pragma once

#include <cstdint>
#include <vector>

namespace surfsup {

// Ordered by receiver, then by sender. The pairs of receiver i are starts[i] to starts[i + 1].
struct NeighborPairs {
    std::vector<int64_t> starts, receivers, senders;
    int64_t count = 0;  // found before the search stopped; -1 where a position is not finite
};

// All ordered pairs of positions (count, 3) within `radius`. Stops beyond `max_pairs`. Throws std::bad_alloc.
NeighborPairs find_neighbor_pairs(const float* positions, int32_t count, double radius, int64_t max_pairs, int threads);

}  // namespace surfsup
