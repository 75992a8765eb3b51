// Matrix products of small blocks in float32 and bfloat16, compiled once for every instruction set.
#pragma once

#include "isa/lanes.hpp"

namespace ISA {
namespace {

constexpr int OUTER_ROWS = LANES >= 16 ? 8 : 4;  // rows of a block of an outer product; every width is a multiple

// Numbers of single precision.
struct Float32 {
    using Value = float;
    static constexpr int GROUP = 1;  // inputs that a product takes at once
    static Floats load(const float* from) { return ISA::load(from); }
    static void store(float* to, Floats values) { ISA::store(to, values); }

    // to[row][column] = start[row][column] + sum over g of a[row][g] * b[g][column], with rows of a `row_step` apart and its
    // columns `group_step` apart. Not inlined: within larger functions the sums would spill from the registers.
    template <int HEIGHT, int VECTORS>
    __attribute__((noinline)) static void block(const float* a, int64_t row_step, int64_t group_step, int groups,
                                                const float* b, int64_t columns, const float* start, int64_t start_step,
                                                float* to) {
        Floats sums[HEIGHT][VECTORS];
#pragma GCC unroll 12
        for (int row = 0; row < HEIGHT; ++row)
#pragma GCC unroll 2
            for (int v = 0; v < VECTORS; ++v) sums[row][v] = load(start + row * start_step + v * LANES);
        for (int g = 0; g < groups; ++g) {
            Floats values[VECTORS];
#pragma GCC unroll 2
            for (int v = 0; v < VECTORS; ++v) values[v] = load(b + g * columns + v * LANES);
#pragma GCC unroll 12
            for (int row = 0; row < HEIGHT; ++row) {
                const Floats factor = splat(a[row * row_step + g * group_step]);
#pragma GCC unroll 2
                for (int v = 0; v < VECTORS; ++v) sums[row][v] += factor * values[v];
            }
        }
#pragma GCC unroll 12
        for (int row = 0; row < HEIGHT; ++row)
#pragma GCC unroll 2
            for (int v = 0; v < VECTORS; ++v) store(to + row * columns + v * LANES, sums[row][v]);
    }

    // Rows (rows, columns) in the layout of a packed matrix with the rows as inputs; `room` is not needed.
    static const float* grouped(const float* values, int, int, float*) { return values; }
};

#if defined(__AVX512BF16__)
// Numbers with the eight exponent bits of single precision and eight significant bits. Sums are in single precision.
struct Bfloat16 {
    using Value = uint16_t;
    static constexpr int GROUP = 2;

    static Floats load(const uint16_t* from) {
        __m256i halves;
        std::memcpy(&halves, from, sizeof halves);
        return (Floats)_mm512_slli_epi32(_mm512_cvtepu16_epi32(halves), 16);
    }

    // Rounds to the nearest, ties to even.
    static void store(uint16_t* to, Floats values) { ISA::store(to, _mm512_cvtneps_pbh((__m512)values)); }

    template <int HEIGHT, int VECTORS>
    __attribute__((noinline)) static void block(const uint16_t* a, int64_t row_step, int64_t group_step, int groups,
                                                const uint16_t* b, int64_t columns, const float* start, int64_t start_step,
                                                float* to) {
        __m512 sums[HEIGHT][VECTORS];
#pragma GCC unroll 12
        for (int row = 0; row < HEIGHT; ++row)
#pragma GCC unroll 2
            for (int v = 0; v < VECTORS; ++v) sums[row][v] = _mm512_loadu_ps(start + row * start_step + v * LANES);
        for (int g = 0; g < groups; ++g) {
            __m512i values[VECTORS];
#pragma GCC unroll 2
            for (int v = 0; v < VECTORS; ++v) values[v] = _mm512_loadu_si512(b + 2 * (g * columns + v * LANES));
#pragma GCC unroll 12
            for (int row = 0; row < HEIGHT; ++row) {
                int32_t pair;
                std::memcpy(&pair, a + row * row_step + g * group_step, sizeof pair);
                const __m512i factor = _mm512_set1_epi32(pair);
#pragma GCC unroll 2
                for (int v = 0; v < VECTORS; ++v)
                    sums[row][v] = _mm512_dpbf16_ps(sums[row][v], (__m512bh)factor, (__m512bh)values[v]);
            }
        }
#pragma GCC unroll 12
        for (int row = 0; row < HEIGHT; ++row)
#pragma GCC unroll 2
            for (int v = 0; v < VECTORS; ++v) _mm512_storeu_ps(to + row * columns + v * LANES, sums[row][v]);
    }

    // An odd number of rows is completed by zeros.
    static const uint16_t* grouped(const uint16_t* values, int rows, int columns, uint16_t* room) {
        for (int row = 0; row < rows; row += 2) {
            const uint16_t *even = values + row * columns, *odd = even + columns;
            uint16_t* to = room + row * columns;
            if (row + 1 < rows)
                for (int c = 0; c < columns; ++c) to[2 * c] = even[c], to[2 * c + 1] = odd[c];
            else
                for (int c = 0; c < columns; ++c) to[2 * c] = even[c], to[2 * c + 1] = 0;
        }
        return room;
    }
};
#endif

// Blocks of HEIGHT rows that together cover at least `rows`, and columns by two vectors or one.
template <typename Number, int HEIGHT>
inline void multiply_blocks(const typename Number::Value* a, int64_t row_step, int64_t group_step, int rows, int groups,
                            const typename Number::Value* b, int columns, const float* start, int64_t start_step, float* to) {
    int column = 0;
    for (; column + 2 * LANES <= columns; column += 2 * LANES)
        for (int row = 0; row < rows; row += HEIGHT)
            Number::template block<HEIGHT, 2>(a + row * row_step, row_step, group_step, groups, b + Number::GROUP * column,
                                              columns, start + row * start_step + column, start_step,
                                              to + static_cast<int64_t>(row) * columns + column);
    for (; column < columns; column += LANES)
        for (int row = 0; row < rows; row += HEIGHT)
            Number::template block<HEIGHT, 1>(a + row * row_step, row_step, group_step, groups, b + Number::GROUP * column,
                                              columns, start + row * start_step + column, start_step,
                                              to + static_cast<int64_t>(row) * columns + column);
}

// Rows of a tile (rows, depth) times a packed matrix, plus `start`, whose rows are `start_step` apart: (rows, columns). Writes
// up to a multiple of ROWS.
template <typename Number>
inline void multiply_tile(const typename Number::Value* a, int rows, int depth, const void* packed, int columns,
                          const float* start, int64_t start_step, float* to) {
    multiply_blocks<Number, ROWS>(a, depth, Number::GROUP, rows, depth / Number::GROUP,
                                  static_cast<const typename Number::Value*>(packed), columns, start, start_step, to);
}

// Adds a's transpose times b to a matrix (depth, columns), for tiles (rows, depth) and (rows, columns). The rooms have the size
// of the tiles, rounded up to even rows.
template <typename Number>
inline void add_outer_product(const typename Number::Value* a, const typename Number::Value* b, int rows, int depth,
                              int columns, float* to, typename Number::Value* a_room, typename Number::Value* b_room) {
    constexpr int GROUP = Number::GROUP;
    multiply_blocks<Number, OUTER_ROWS>(Number::grouped(a, rows, depth, a_room), GROUP, GROUP * depth, depth,
                                        (rows + GROUP - 1) / GROUP, Number::grouped(b, rows, columns, b_room), columns, to,
                                        columns, to);
}

}  // namespace
}  // namespace ISA
