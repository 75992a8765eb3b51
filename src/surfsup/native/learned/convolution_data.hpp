// Neighbor graph of a convolution as plain data.
#pragma once

#include <cstdint>

namespace surfsup {

constexpr int KERNELS = 4;  // of an edge: the smoothing kernel and its gradient

// The edges of particle i are starts[i] to starts[i + 1]. With every edge there is its reverse, whose kernels differ in the
// sign of all but the first.
struct NeighborGraph {
    int32_t count;
    const int64_t *starts, *senders;
    const float* kernels;  // (edges, KERNELS)
};

}  // namespace surfsup
