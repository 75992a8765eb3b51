#include "learned/kernel_sums.hpp"

#include <cstring>

#include "runtime/threads.hpp"

namespace surfsup {
namespace {

constexpr int32_t PORTION = 48;                     // particles
constexpr float PARITY[KERNELS] = {1, -1, -1, -1};  // sign of each kernel when an edge is reversed

}  // namespace

void sum_kernels(const NeighborGraph& graph, const float* values, float* sums, int threads) {
    in_parallel(threads, graph.count, PORTION, [&](int, int32_t begin, int32_t end) {
        for (int32_t i = begin; i < end; ++i) {
            float to[KERNELS][4] = {};
            for (int64_t e = graph.starts[i]; e < graph.starts[i + 1]; ++e)
                for (int m = 0; m < KERNELS; ++m)
                    for (int c = 0; c < 4; ++c) to[m][c] += graph.kernels[KERNELS * e + m] * values[4 * graph.senders[e] + c];
            std::memcpy(sums + static_cast<int64_t>(i) * KERNELS * 4, to, sizeof to);
        }
    });
}

void sum_kernels_gradient(const NeighborGraph& graph, const float* sums_gradient, float* values_gradient, int threads) {
    in_parallel(threads, graph.count, PORTION, [&](int, int32_t begin, int32_t end) {
        for (int32_t i = begin; i < end; ++i) {
            float to[4] = {};
            for (int64_t e = graph.starts[i]; e < graph.starts[i + 1]; ++e) {
                const float* from = sums_gradient + graph.senders[e] * KERNELS * 4;
                for (int m = 0; m < KERNELS; ++m)
                    for (int c = 0; c < 4; ++c) to[c] += PARITY[m] * graph.kernels[KERNELS * e + m] * from[4 * m + c];
            }
            std::memcpy(values_gradient + static_cast<int64_t>(i) * 4, to, sizeof to);
        }
    });
}

}  // namespace surfsup
