// The convolution of convolution.hpp, compiled once a isa.
#pragma once

#include "learned/network_isa.hpp"
#include "sph/neighbor_search_isa.hpp"

namespace ISA {
namespace {

using surfsup::Channels;
using surfsup::Sparse;

// Sums over the neighbors of particle i of VECTORS vectors of channels, for every kernel apart; values and sums lie
// so many floats apart from one particle, and one kernel, to the next.
template <int VECTORS>
inline void gather_edges(const Sparse& edges, int32_t i, const float* values, int values_row, bool back, float* to, int to_row) {
    Floats sums[KERNELS][VECTORS];
#pragma GCC unroll 4
    for (int m = 0; m < KERNELS; ++m)
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) sums[m][v] = Floats{};
    for (int64_t e = edges.starts[i]; e < edges.starts[i + 1]; ++e) {
        const float *from = values + edges.senders[e] * values_row, *kernel = edges.kernels + KERNELS * e;
        Floats sent[VECTORS];
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) sent[v] = load(from + v * LANES);
#pragma GCC unroll 4
        for (int m = 0; m < KERNELS; ++m) {
            const Floats weight = splat(kernel[m]);
#pragma GCC unroll 2
            for (int v = 0; v < VECTORS; ++v) sums[m][v] += weight * sent[v];
        }
    }
#pragma GCC unroll 4
    for (int m = 0; m < KERNELS; ++m)
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) store(to + m * to_row + v * LANES, back && m > 0 ? -sums[m][v] : sums[m][v]);
}

// The four sums of a particle over the first `messages` of its neighbors' channels, and behind them all of its own.
inline void gather_row(const Sparse& edges, int32_t i, Channels channels, const float* values, bool back, float* to) {
    const int width = channels.width, messages = channels.messages;
    int column = 0;
    for (; column + GATHERED * LANES <= messages; column += GATHERED * LANES)
        gather_edges<GATHERED>(edges, i, values + column, width, back, to + column, messages);
    for (; column < messages; column += LANES)
        gather_edges<1>(edges, i, values + column, width, back, to + column, messages);
    std::memcpy(to + KERNELS * messages, values + static_cast<int64_t>(i) * width, 4 * static_cast<size_t>(width));
}

void convolve(const Sparse& edges, Channels channels, const float* values, const float* weights, float* out,
              int32_t begin, int32_t end, float* sums) {
    const int width = channels.width, depth = KERNELS * channels.messages + width;
    for (int32_t block = begin; block < end; block += ROWS) {
        const int here = end - block < ROWS ? end - block : ROWS;
        for (int row = 0; row < here; ++row) gather_row(edges, block + row, channels, values, false, sums + row * depth);
        product(sums, depth, depth, weights, width, [&](int row, int column, Floats sum) {
            if (row < here) store(out + static_cast<int64_t>(block + row) * width + column, sum);
        });
    }
}

void convolve_back(const Sparse& edges, Channels channels, const float* gradient, const float* weights, float* to_values,
                   int32_t begin, int32_t end, float* sums) {
    const int width = channels.width, messages = channels.messages;
    const int depth = (KERNELS + 1) * width;
    for (int32_t block = begin; block < end; block += ROWS) {
        const int here = end - block < ROWS ? end - block : ROWS;
        for (int row = 0; row < here; ++row) gather_row(edges, block + row, {width, width}, gradient, true, sums + row * depth);
        const auto write = [&](int row, int column, Floats sum) {
            if (row < here) store(to_values + static_cast<int64_t>(block + row) * width + column, sum);
        };
        product(sums, depth, depth, weights, width, messages, write);
        // What no neighbor was told of comes back from the particle itself alone.
        product(sums + KERNELS * width, depth, width, weights + KERNELS * width * width + messages, width, width - messages,
                [&](int row, int column, Floats sum) { write(row, messages + column, sum); });
    }
}

// to[k][column] += sum over a block's rows of a[row][k] * b[row][column], for VECTORS vectors of columns.
template <int VECTORS>
inline void add_outer(const float* a, int64_t depth, const float* b, int64_t b_row, float* to, int64_t to_row) {
    Floats columns[ROWS][VECTORS];
#pragma GCC unroll 12
    for (int row = 0; row < ROWS; ++row)
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) columns[row][v] = load(b + row * b_row + v * LANES);
    for (int64_t k = 0; k < depth; ++k) {
        Floats sums[VECTORS];
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) sums[v] = load(to + k * to_row + v * LANES);
#pragma GCC unroll 12
        for (int row = 0; row < ROWS; ++row) {
            const Floats value = splat(a[row * depth + k]);
#pragma GCC unroll 2
            for (int v = 0; v < VECTORS; ++v) sums[v] += value * columns[row][v];
        }
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) store(to + k * to_row + v * LANES, sums[v]);
    }
}

void weigh(const Sparse& edges, Channels channels, const float* values, const float* gradient, float* to, int32_t begin,
           int32_t end, float* sums) {
    const int width = channels.width, depth = KERNELS * channels.messages + width;
    float* wanted = sums + ROWS * depth;
    for (int32_t block = begin; block < end; block += ROWS) {
        const int here = end - block < ROWS ? end - block : ROWS;
        for (int row = 0; row < ROWS; ++row) {
            float* row_wanted = wanted + row * width;
            if (row < here) {
                gather_row(edges, block + row, channels, values, false, sums + row * depth);
                std::memcpy(row_wanted, gradient + static_cast<int64_t>(block + row) * width, 4 * static_cast<size_t>(width));
            } else {
                std::memset(sums + row * depth, 0, 4 * static_cast<size_t>(depth));
                std::memset(row_wanted, 0, 4 * static_cast<size_t>(width));
            }
        }
        int column = 0;
        for (; column + 2 * LANES <= width; column += 2 * LANES)
            add_outer<2>(sums, depth, wanted + column, width, to + column, width);
        for (; column < width; column += LANES) add_outer<1>(sums, depth, wanted + column, width, to + column, width);
    }
}

int64_t within(const Frame& frame, int32_t i, Arena& arena, void* memory, const int32_t*& to) {
    auto& search = *static_cast<Search*>(memory);
    const int32_t cell = frame.cells.of[i];
    if (cell + 1 != search.cell && !see_cell(frame, cell, search, arena)) return -1;
    if (!find_within(frame, i, 0, search, arena)) return -1;
    to = search.within[0];
    return search.found[0];
}

}  // namespace
}  // namespace ISA
