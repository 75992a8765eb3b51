#include "learned/convolution.hpp"

#include <algorithm>
#include <vector>

#include "isa/isa.hpp"
#include "runtime/aligned.hpp"
#include "runtime/threads.hpp"

namespace surfsup {
namespace {

constexpr int32_t PORTION = 48;  // particles, a multiple of every instruction set's rows
constexpr int SLICES = 8;        // of the particles; their sums are added in this order, whatever the number of threads

const Isa& fastest() {
    static const Isa& isa = *instruction_sets().front();
    return isa;
}

std::vector<AlignedFloats> scratch_of(int threads, int width) {
    const auto size = static_cast<size_t>(fastest().learned->rows * (KERNELS + 2) * width);
    return std::vector<AlignedFloats>(static_cast<size_t>(std::max(1, threads)), AlignedFloats(size));
}

// The weights transposed to a row per input: the inputs of each kernel, then the particle's own.
AlignedFloats rows_per_input(int width, const float* mix, const float* self) {
    AlignedFloats weights(static_cast<size_t>((KERNELS + 1) * width * width));
    float* to = weights.data();
    for (int m = 0; m <= KERNELS; ++m) {
        const float* matrix = m < KERNELS ? mix + m * width * width : self;
        for (int input = 0; input < width; ++input, to += width)
            for (int output = 0; output < width; ++output) to[output] = matrix[output * width + input];
    }
    return weights;
}

}  // namespace

void convolve(const NeighborGraph& graph, int width, const float* hidden, const float* mix, const float* self, float* out,
              int threads) {
    const AlignedFloats weights = rows_per_input(width, mix, self);
    auto scratch = scratch_of(threads, width);
    in_parallel(threads, graph.count, PORTION, [&](int thread, int32_t begin, int32_t end) {
        fastest().learned->convolve(graph, width, hidden, weights.data(), out, begin, end,
                                    scratch[static_cast<size_t>(thread)].data());
    });
}

void convolve_gradient(const NeighborGraph& graph, int width, const float* hidden, const float* mix, const float* self,
                       const float* out_gradient, float* hidden_gradient, float* mix_gradient, float* self_gradient,
                       int threads) {
    auto scratch = scratch_of(threads, width);
    const auto size = static_cast<size_t>((KERNELS + 1) * width * width);
    if (hidden_gradient) {
        AlignedFloats weights(size);
        std::copy_n(self, width * width, std::copy_n(mix, KERNELS * width * width, weights.data()));
        in_parallel(threads, graph.count, PORTION, [&](int thread, int32_t begin, int32_t end) {
            fastest().learned->convolve_values_gradient(graph, width, out_gradient, weights.data(), hidden_gradient, begin, end,
                                                        scratch[static_cast<size_t>(thread)].data());
        });
    }
    std::vector<AlignedFloats> slices(SLICES, AlignedFloats(size, 0.0f));
    in_parallel(threads, SLICES, 1, [&](int thread, int32_t slice, int32_t) {
        const auto begin = static_cast<int32_t>(static_cast<int64_t>(graph.count) * slice / SLICES);
        const auto end = static_cast<int32_t>(static_cast<int64_t>(graph.count) * (slice + 1) / SLICES);
        fastest().learned->convolve_weights_gradient(graph, width, hidden, out_gradient,
                                                     slices[static_cast<size_t>(slice)].data(), begin, end,
                                                     scratch[static_cast<size_t>(thread)].data());
    });
    for (int slice = 1; slice < SLICES; ++slice)
        for (size_t k = 0; k < size; ++k) slices[0][k] += slices[static_cast<size_t>(slice)][k];
    const float* from = slices[0].data();
    for (int m = 0; m <= KERNELS; ++m) {
        float* to = m < KERNELS ? mix_gradient + m * width * width : self_gradient;
        for (int input = 0; input < width; ++input, from += width)
            for (int output = 0; output < width; ++output) to[output * width + input] = from[output];
    }
}

}  // namespace surfsup
