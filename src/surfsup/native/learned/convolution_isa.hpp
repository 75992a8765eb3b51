// The convolution of convolution.hpp, compiled once for every instruction set.
#pragma once

#include "isa/lanes.hpp"
#include "learned/convolution_data.hpp"

namespace ISA {
namespace {

using surfsup::KERNELS;
using surfsup::NeighborGraph;

// sums[row][column] = sum over k of a[row][k] * w[k][column], for HEIGHT rows and VECTORS vectors of columns.
template <int HEIGHT, int VECTORS>
inline void multiply(const float* a, int64_t a_row, int depth, const float* w, int64_t w_row, Floats (&sums)[HEIGHT][VECTORS]) {
#pragma GCC unroll 12
    for (int row = 0; row < HEIGHT; ++row)
#pragma GCC unroll 3
        for (int v = 0; v < VECTORS; ++v) sums[row][v] = Floats{};
    for (int k = 0; k < depth; ++k) {
        Floats columns[VECTORS];
#pragma GCC unroll 3
        for (int v = 0; v < VECTORS; ++v) columns[v] = load(w + k * w_row + v * LANES);
#pragma GCC unroll 12
        for (int row = 0; row < HEIGHT; ++row) {
            const Floats value = splat(a[row * a_row + k]);
#pragma GCC unroll 3
            for (int v = 0; v < VECTORS; ++v) sums[row][v] += value * columns[v];
        }
    }
}

// Product of a block of rows with a matrix, HEIGHT rows at a time; `use` receives (row, column, values) of every vector. Not
// inlined: within larger functions the sums would spill from the registers.
template <int HEIGHT, int VECTORS, typename Use>
__attribute__((noinline)) void product_of(const float* a, int depth, const float* w, int columns, Use use) {
    for (int first = 0; first < ROWS; first += HEIGHT)
        for (int column = 0; column < columns; column += VECTORS * LANES) {
            Floats sums[HEIGHT][VECTORS];
            multiply(a + first * static_cast<int64_t>(depth), depth, depth, w + column, columns, sums);
#pragma GCC unroll 12
            for (int row = 0; row < HEIGHT; ++row)
#pragma GCC unroll 3
                for (int v = 0; v < VECTORS; ++v) use(first + row, column + v * LANES, sums[row][v]);
        }
}

template <typename Use>
inline void product(const float* a, int depth, const float* w, int columns, Use use) {
    if (columns % (2 * LANES) == 0)
        product_of<ROWS, 2>(a, depth, w, columns, use);
    else if (columns % (3 * LANES) == 0)
        product_of<ROWS / 2, 3>(a, depth, w, columns, use);
    else
        product_of<ROWS, 1>(a, depth, w, columns, use);
}

// Sums over the neighbors of particle i of VECTORS vectors of channels, separately for every kernel.
template <int VECTORS>
inline void gather_edges(const NeighborGraph& graph, int32_t i, const float* values, int width, bool reversed, float* to) {
    Floats sums[KERNELS][VECTORS];
#pragma GCC unroll 4
    for (int m = 0; m < KERNELS; ++m)
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) sums[m][v] = Floats{};
    for (int64_t e = graph.starts[i]; e < graph.starts[i + 1]; ++e) {
        const float *from = values + graph.senders[e] * width, *kernel = graph.kernels + KERNELS * e;
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
        for (int v = 0; v < VECTORS; ++v) store(to + m * width + v * LANES, reversed && m > 0 ? -sums[m][v] : sums[m][v]);
}

// The sums of every kernel over a particle's neighbors, followed by the particle's own values.
inline void gather_row(const NeighborGraph& graph, int32_t i, int width, const float* values, bool reversed, float* to) {
    int column = 0;
    for (; column + 2 * LANES <= width; column += 2 * LANES)
        gather_edges<2>(graph, i, values + column, width, reversed, to + column);
    for (; column < width; column += LANES) gather_edges<1>(graph, i, values + column, width, reversed, to + column);
    std::memcpy(to + KERNELS * width, values + static_cast<int64_t>(i) * width, 4 * static_cast<size_t>(width));
}

inline void convolve_any(const NeighborGraph& graph, int width, const float* values, bool reversed, const float* weights,
                         float* out, int32_t begin, int32_t end, float* sums) {
    const int depth = (KERNELS + 1) * width;
    for (int32_t block = begin; block < end; block += ROWS) {
        const int here = end - block < ROWS ? end - block : ROWS;
        for (int row = 0; row < here; ++row) gather_row(graph, block + row, width, values, reversed, sums + row * depth);
        product(sums, depth, weights, width, [&](int row, int column, Floats sum) {
            if (row < here) store(out + static_cast<int64_t>(block + row) * width + column, sum);
        });
    }
}

void convolve(const NeighborGraph& graph, int width, const float* values, const float* weights, float* out, int32_t begin,
              int32_t end, float* sums) {
    convolve_any(graph, width, values, false, weights, out, begin, end, sums);
}

// A gradient travels along the reversed edges.
void convolve_values_gradient(const NeighborGraph& graph, int width, const float* gradient, const float* weights,
                              float* values_gradient, int32_t begin, int32_t end, float* sums) {
    convolve_any(graph, width, gradient, true, weights, values_gradient, begin, end, sums);
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

// Adds the gradient with respect to the weights ((KERNELS + 1) width, width).
void convolve_weights_gradient(const NeighborGraph& graph, int width, const float* values, const float* gradient,
                               float* weights_gradient, int32_t begin, int32_t end, float* sums) {
    const int depth = (KERNELS + 1) * width;
    float* block_gradient = sums + ROWS * depth;
    for (int32_t block = begin; block < end; block += ROWS) {
        const int here = end - block < ROWS ? end - block : ROWS;
        for (int row = 0; row < ROWS; ++row) {
            float* row_gradient = block_gradient + row * width;
            if (row < here) {
                gather_row(graph, block + row, width, values, false, sums + row * depth);
                std::memcpy(row_gradient, gradient + static_cast<int64_t>(block + row) * width, 4 * static_cast<size_t>(width));
            } else {
                std::memset(sums + row * depth, 0, 4 * static_cast<size_t>(depth));
                std::memset(row_gradient, 0, 4 * static_cast<size_t>(width));
            }
        }
        int column = 0;
        for (; column + 2 * LANES <= width; column += 2 * LANES)
            add_outer<2>(sums, depth, block_gradient + column, width, weights_gradient + column, width);
        for (; column < width; column += LANES)
            add_outer<1>(sums, depth, block_gradient + column, width, weights_gradient + column, width);
    }
}

}  // namespace
}  // namespace ISA
