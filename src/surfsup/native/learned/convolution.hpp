// A neighbor convolution and its gradients, see learned/corrected/convolution.py.
#pragma once

#include "learned/convolution_data.hpp"

namespace surfsup {

// out_i = self h_i + sum_j sum_m k_m(i, j) mix_m h_j for hidden states h (count, width); the width is a multiple of CHANNELS.
// `mix` is (KERNELS width, width), `self` (width, width), one row per output, as torch stores them.
constexpr int CHANNELS = 16;

void convolve(const NeighborGraph& graph, int width, const float* hidden, const float* mix, const float* self, float* out,
              int threads);

// Gradients with respect to h (unless null), mix and self. The order of summation does not depend on the number of threads.
void convolve_gradient(const NeighborGraph& graph, int width, const float* hidden, const float* mix, const float* self,
                       const float* out_gradient, float* hidden_gradient, float* mix_gradient, float* self_gradient,
                       int threads);

}  // namespace surfsup
