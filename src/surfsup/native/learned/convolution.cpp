#include "learned/convolution.hpp"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <new>

#include "runtime/aligned.hpp"
#include "runtime/arena.hpp"
#include "sph/cell_list.hpp"
#include "sph/frame.hpp"
#include "sph/solver.hpp"
#include "runtime/threads.hpp"

namespace surfsup {
namespace {

constexpr int32_t PORTION = 48;  // particles, a multiple of every isa's rows
constexpr int SLICES = 8;        // of the particles, whose sums are made apart and then added, always in this order
constexpr float WIDER = 1.0001f; // a first look in single precision, before the exact one
constexpr float PARITY[KERNELS] = {1, -1, -1, -1};

const Isa& fastest() {
    static const Isa& isa = *instruction_sets().front();
    return isa;
}

std::vector<AlignedFloats> scratch_of(int threads, int width) {
    const auto size = static_cast<size_t>(fastest().rows * (KERNELS + 2) * width);
    return std::vector<AlignedFloats>(static_cast<size_t>(std::max(1, threads)), AlignedFloats(size));
}

int inputs_of(int kernel, Channels channels) { return kernel < KERNELS ? channels.messages : channels.width; }

// Rows (inputs by kernel, then the own inputs) from matrices with a row an output.
AlignedFloats inputs_first(Channels channels, const float* mix, const float* own) {
    const int width = channels.width, messages = channels.messages;
    AlignedFloats weights(static_cast<size_t>((KERNELS * messages + width) * width));
    float* to = weights.data();
    for (int m = 0; m <= KERNELS; ++m) {
        const float* matrix = m < KERNELS ? mix + m * width * messages : own;
        const int inputs = inputs_of(m, channels);
        for (int input = 0; input < inputs; ++input, to += width)
            for (int output = 0; output < width; ++output) to[output] = matrix[output * inputs + input];
    }
    return weights;
}

// The same with a row an output, for gradients; of what neighbors are not told of it is zero.
AlignedFloats outputs_first(Channels channels, const float* mix, const float* own) {
    const int width = channels.width, messages = channels.messages;
    AlignedFloats weights(static_cast<size_t>((KERNELS + 1) * width * width), 0.0f);
    for (int row = 0; row < KERNELS * width; ++row) std::copy_n(mix + row * messages, messages, weights.data() + row * width);
    std::copy_n(own, width * width, weights.data() + KERNELS * width * width);
    return weights;
}

}  // namespace

void convolve(const Sparse& edges, Channels channels, const float* hidden, const float* mix, const float* own, float* out,
              int threads) {
    const AlignedFloats weights = inputs_first(channels, mix, own);
    auto scratch = scratch_of(threads, channels.width);
    in_parallel(threads, edges.count, PORTION, [&](int thread, int32_t begin, int32_t end) {
        fastest().convolve(edges, channels, hidden, weights.data(), out, begin, end,
                           scratch[static_cast<size_t>(thread)].data());
    });
}

void convolve_back(const Sparse& edges, Channels channels, const float* hidden, const float* mix, const float* own,
                   const float* gradient, float* to_hidden, float* to_mix, float* to_own, int threads) {
    const int width = channels.width, messages = channels.messages;
    auto scratch = scratch_of(threads, width);
    if (to_hidden) {
        const AlignedFloats weights = outputs_first(channels, mix, own);
        in_parallel(threads, edges.count, PORTION, [&](int thread, int32_t begin, int32_t end) {
            fastest().convolve_back(edges, channels, gradient, weights.data(), to_hidden, begin, end,
                                    scratch[static_cast<size_t>(thread)].data());
        });
    }
    const auto size = static_cast<size_t>((KERNELS * messages + width) * width);
    std::vector<AlignedFloats> slices(SLICES, AlignedFloats(size, 0.0f));
    in_parallel(threads, SLICES, 1, [&](int thread, int32_t slice, int32_t) {
        const auto begin = static_cast<int32_t>(static_cast<int64_t>(edges.count) * slice / SLICES);
        const auto end = static_cast<int32_t>(static_cast<int64_t>(edges.count) * (slice + 1) / SLICES);
        fastest().weigh(edges, channels, hidden, gradient, slices[static_cast<size_t>(slice)].data(), begin, end,
                        scratch[static_cast<size_t>(thread)].data());
    });
    for (int slice = 1; slice < SLICES; ++slice)
        for (size_t k = 0; k < size; ++k) slices[0][k] += slices[static_cast<size_t>(slice)][k];
    const float* from = slices[0].data();
    for (int m = 0; m <= KERNELS; ++m) {
        float* to = m < KERNELS ? to_mix + m * width * messages : to_own;
        const int inputs = inputs_of(m, channels);
        for (int input = 0; input < inputs; ++input, from += width)
            for (int output = 0; output < width; ++output) to[output * inputs + input] = from[output];
    }
}

void sum_fours(const Sparse& edges, const float* values, float* sums, int threads) {
    in_parallel(threads, edges.count, PORTION, [&](int, int32_t begin, int32_t end) {
        for (int32_t i = begin; i < end; ++i) {
            float to[KERNELS][4] = {};
            for (int64_t e = edges.starts[i]; e < edges.starts[i + 1]; ++e)
                for (int m = 0; m < KERNELS; ++m)
                    for (int c = 0; c < 4; ++c) to[m][c] += edges.kernels[KERNELS * e + m] * values[4 * edges.senders[e] + c];
            std::memcpy(sums + static_cast<int64_t>(i) * KERNELS * 4, to, sizeof to);
        }
    });
}

void sum_fours_back(const Sparse& edges, const float* gradient, float* to_values, int threads) {
    in_parallel(threads, edges.count, PORTION, [&](int, int32_t begin, int32_t end) {
        for (int32_t i = begin; i < end; ++i) {
            float to[4] = {};
            for (int64_t e = edges.starts[i]; e < edges.starts[i + 1]; ++e) {
                const float* from = gradient + edges.senders[e] * KERNELS * 4;
                for (int m = 0; m < KERNELS; ++m)
                    for (int c = 0; c < 4; ++c) to[c] += PARITY[m] * edges.kernels[KERNELS * e + m] * from[4 * m + c];
            }
            std::memcpy(to_values + static_cast<int64_t>(i) * 4, to, sizeof to);
        }
    });
}

Pairs find_pairs(const float* positions, int32_t count, float radius, double exact_radius, int64_t most_edges, int threads) {
    Pairs pairs;
    CellList cells;
    if (count > 0 && !cells.sort(positions, count, radius * WIDER)) {
        pairs.edges = -1;
        return pairs;
    }
    const int32_t* order = cells.order();
    std::vector<float> places[3];
    for (int axis = 0; axis < 3; ++axis) {
        places[axis].resize(static_cast<size_t>(count) + 16);
        for (int32_t i = 0; i < count; ++i)
            places[axis][static_cast<size_t>(i)] = positions[3 * static_cast<int64_t>(order[i]) + axis];
    }
    Frame frame{};
    frame.count = count;
    frame.constants.radius = radius * WIDER;
    frame.cells = cells.cells();
    frame.x = places[0].data(), frame.y = places[1].data(), frame.z = places[2].data();

    const int most = std::max(1, threads);
    const Isa& isa = fastest();
    std::vector<Arena> arenas(static_cast<size_t>(most));
    std::vector<std::vector<char>> searches(static_cast<size_t>(most), std::vector<char>(static_cast<size_t>(isa.search_bytes)));
    struct List {
        int32_t* senders = nullptr;
        int64_t count = 0;
    };
    std::vector<List> lists(static_cast<size_t>(count));
    std::atomic<int64_t> edges{0};
    std::atomic<bool> enough{true};
    in_parallel(most, count, PORTION, [&](int thread, int32_t begin, int32_t end) {
        if (!enough || edges > most_edges) return;
        const auto t = static_cast<size_t>(thread);
        int64_t here = 0;
        for (int32_t i = begin; i < end; ++i) {
            const int32_t* found = nullptr;
            const int64_t near = isa.within(frame, i, arenas[t], searches[t].data(), found);
            auto* kept = near < 0 ? nullptr : static_cast<int32_t*>(arenas[t].take(4 * near));
            if (!kept) {
                enough = false;
                return;
            }
            const int32_t caller = order[i];
            int64_t size = 0;
            for (int64_t k = 0; k < near; ++k) {
                const int32_t other = order[found[k]];
                double squared = 0;
                for (int axis = 0; axis < 3; ++axis) {
                    const double apart = static_cast<double>(positions[3 * static_cast<int64_t>(other) + axis]) -
                                         positions[3 * static_cast<int64_t>(caller) + axis];
                    squared += apart * apart;
                }
                if (squared <= exact_radius * exact_radius) kept[size++] = other;
            }
            std::sort(kept, kept + size);
            lists[static_cast<size_t>(caller)] = {kept, size};
            here += size;
        }
        edges += here;
    });
    if (!enough) throw std::bad_alloc();
    pairs.edges = edges;
    if (edges > most_edges) return pairs;
    pairs.starts.resize(static_cast<size_t>(count) + 1);
    pairs.receivers.resize(static_cast<size_t>(edges));
    pairs.senders.resize(static_cast<size_t>(edges));
    int64_t at = 0;
    for (int32_t i = 0; i < count; ++i) {
        pairs.starts[static_cast<size_t>(i)] = at;
        const List& list = lists[static_cast<size_t>(i)];
        for (int64_t k = 0; k < list.count; ++k, ++at) {
            pairs.receivers[static_cast<size_t>(at)] = i;
            pairs.senders[static_cast<size_t>(at)] = list.senders[k];
        }
    }
    pairs.starts.back() = at;
    return pairs;
}

}  // namespace surfsup
