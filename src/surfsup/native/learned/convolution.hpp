// One convolution over neighbors and its gradients, for training: see convolution.py and network.py.
#pragma once

#include <cstdint>
#include <vector>

#include "sph/frame.hpp"

namespace surfsup {

// out_i = own h_i + sum_j sum_m k_m(i, j) mix_m h_j, where of h_j only the first `messages` channels count; both numbers
// of channels are multiples of CHANNELS. `mix` is (4 width, messages), `own` (width, width), a row an output, as torch
// keeps them.
constexpr int CHANNELS = 16;

void convolve(const Sparse& edges, Channels channels, const float* hidden, const float* mix, const float* own, float* out,
              int threads);

// Gradients in h, mix and own from that in `out`. The sums are made in an order that does not depend on the threads.
void convolve_back(const Sparse& edges, Channels channels, const float* hidden, const float* mix, const float* own,
                   const float* gradient, float* to_hidden, float* to_mix, float* to_own, int threads);

// sums_im = sum_j k_m(i, j) v_j of four values a particle, (count, 4, 4); and the gradient in v from that in the sums.
void sum_fours(const Sparse& edges, const float* values, float* sums, int threads);
void sum_fours_back(const Sparse& edges, const float* gradient, float* to_values, int threads);

// All ordered pairs of positions (count, 3) within `radius`, by receiver, then by sender.
struct Pairs {
    std::vector<int64_t> starts, receivers, senders;
    int64_t edges = 0;  // found before it stopped; -1 where a position is not finite
};

// Stops where there are more than `most_edges`. Throws std::bad_alloc.
Pairs find_pairs(const float* positions, int32_t count, float radius, double exact_radius, int64_t most_edges, int threads);

}  // namespace surfsup
