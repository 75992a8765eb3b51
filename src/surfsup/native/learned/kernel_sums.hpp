// Sums of kernels times four values per particle over a neighbor graph, and their gradient.
#pragma once

#include "learned/convolution_data.hpp"

namespace surfsup {

// sums_im = sum_j k_m(i, j) v_j: values (count, 4) -> sums (count, KERNELS, 4).
void sum_kernels(const NeighborGraph& graph, const float* values, float* sums, int threads);
void sum_kernels_gradient(const NeighborGraph& graph, const float* sums_gradient, float* values_gradient, int threads);

}  // namespace surfsup
