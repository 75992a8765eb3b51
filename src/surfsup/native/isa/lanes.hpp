// A vector with the lanes of this translation unit's instruction set, and its functions. Compiled once for every instruction
// set, each time in a namespace of its own: nothing here may be shared.
#pragma once

#include <cstdint>
#include <cstring>

#if defined(__AVX2__)
#include <immintrin.h>
#endif

// A file that defines SIXTEEN_LANES has them where the processor does.
#if defined(SIXTEEN_LANES) && defined(__AVX512F__)
#define WIDE
#endif

namespace ISA {
namespace {

#if defined(WIDE)
constexpr int LANES = 16;
constexpr int ROWS = 12;  // particles in a block: 12 x 2 sums of a matrix product fit the 32 registers
#elif defined(__AVX2__)
constexpr int LANES = 8;
constexpr int ROWS = 6;  // 6 x 2 sums fit the 16 registers
#else
constexpr int LANES = 4;
constexpr int ROWS = 6;
#endif

typedef float Floats __attribute__((vector_size(4 * LANES)));
typedef int32_t Ints __attribute__((vector_size(4 * LANES)));

inline Floats splat(float value) { return value - Floats{}; }

inline Floats load(const float* from) {
    Floats values;
    std::memcpy(&values, from, sizeof values);
    return values;
}

inline Ints load_ints(const int32_t* from) {
    Ints values;
    std::memcpy(&values, from, sizeof values);
    return values;
}

template <typename Vector>
inline void store(void* to, Vector values) {
    std::memcpy(to, &values, sizeof values);
}

// Stores to an aligned place past the caches, which need not read it first: for what is read much later.
inline void store_past_caches(float* to, Floats values) {
#if defined(WIDE)
    _mm512_stream_ps(to, (__m512)values);
#elif defined(__AVX2__)
    _mm256_stream_ps(to, (__m256)values);
#else
    store(to, values);
#endif
}

inline Floats square_root(Floats values) {
#if defined(WIDE)
    return (Floats)_mm512_sqrt_ps((__m512)values);
#elif defined(__AVX2__)
    return (Floats)_mm256_sqrt_ps((__m256)values);
#else
    Floats roots = values;
    for (int lane = 0; lane < LANES; ++lane) roots[lane] = __builtin_sqrtf(values[lane]);
    return roots;
#endif
}

// 1 / x with relative error 2e-7, for normal x with a normal reciprocal.
inline Floats reciprocal(Floats x) {
#if defined(WIDE)
    const Floats guess = (Floats)_mm512_rcp14_ps((__m512)x);
    return guess * (2.0f - x * guess);  // one Newton step
#elif defined(__AVX2__)
    const Floats guess = (Floats)_mm256_rcp_ps((__m256)x);
    return guess * (2.0f - x * guess);
#else
    return 1.0f / x;
#endif
}

// 1 / sqrt(x) with relative error 3e-7, for normal x.
inline Floats reciprocal_root(Floats x) {
#if defined(WIDE)
    const Floats guess = (Floats)_mm512_rsqrt14_ps((__m512)x);
    return guess * (1.5f - 0.5f * x * guess * guess);
#elif defined(__AVX2__)
    const Floats guess = (Floats)_mm256_rsqrt_ps((__m256)x);
    return guess * (1.5f - 0.5f * x * guess * guess);
#else
    Floats roots = x;
    for (int lane = 0; lane < LANES; ++lane) roots[lane] = 1.0f / __builtin_sqrtf(x[lane]);
    return roots;
#endif
}

// NaN stays NaN: comparisons with it are false.
inline Floats at_most(Floats values, float most) { return values > most ? splat(most) : values; }
inline Floats at_least(Floats values, float least) { return values < least ? splat(least) : values; }

// Nearest integer of values within the range of an int, by the rounding of an addition.
inline Floats rounded(Floats values) {
    const Floats shift = splat(12582912.0f);  // 1.5 * 2^23
    return (values + shift) - shift;
}

// e^x with relative error 2e-7; the argument is clamped to +-87.
inline Floats exponential(Floats x) {
    x = at_least(at_most(x, 87.0f), -87.0f);
    const Floats whole = rounded(x * 1.44269504f);
    const Floats rest = (x - whole * 0.693359375f) + whole * 2.12194440e-4f;
    Floats sum = splat(1.9875691500e-4f);  // Cephes expf
    sum = sum * rest + 1.3981999507e-3f;
    sum = sum * rest + 8.3334519073e-3f;
    sum = sum * rest + 4.1665795894e-2f;
    sum = sum * rest + 1.6666665459e-1f;
    sum = sum * rest + 5.0000001201e-1f;
    sum = sum * rest * rest + rest + 1.0f;
    const Ints power = (__builtin_convertvector(whole, Ints) + 127) << 23;
    return sum * (Floats)power;
}

inline Floats sigmoid(Floats x) { return reciprocal(1.0f + exponential(-x)); }

inline Floats silu(Floats x) { return x * sigmoid(x); }

// The sum of the lanes.
inline float sum(Floats values) {
#if defined(WIDE)
    return _mm512_reduce_add_ps((__m512)values);
#elif defined(__AVX2__)
    const __m128 four = _mm_add_ps(_mm256_castps256_ps128((__m256)values), _mm256_extractf128_ps((__m256)values, 1));
    const __m128 two = _mm_add_ps(four, _mm_movehl_ps(four, four));
    return _mm_cvtss_f32(_mm_add_ss(two, _mm_movehdup_ps(two)));
#else
    float total = 0.0f;
    for (int lane = 0; lane < LANES; ++lane) total += values[lane];
    return total;
#endif
}

// Eight floats with every instruction set.
typedef float Eight __attribute__((vector_size(32)));

// Sums of the lanes of eight vectors. Together they take less than half the time of one by one.
inline void sum_each(const Eight (&values)[8], float* to) {
#if defined(__AVX2__)
    __m256 fours[2];
    for (int half = 0; half < 2; ++half) {
        const Eight* four = values + 4 * half;
        const __m256 a = (__m256)four[0], b = (__m256)four[1], c = (__m256)four[2], d = (__m256)four[3];
        const __m256 ab = _mm256_add_ps(_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
        const __m256 cd = _mm256_add_ps(_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
        fours[half] = _mm256_add_ps(_mm256_shuffle_ps(ab, cd, 0x44), _mm256_shuffle_ps(ab, cd, 0xEE));
    }
    const __m256 low = _mm256_permute2f128_ps(fours[0], fours[1], 0x20),
                 high = _mm256_permute2f128_ps(fours[0], fours[1], 0x31);
    _mm256_storeu_ps(to, _mm256_add_ps(low, high));
#else
    for (int k = 0; k < 8; ++k) {
        to[k] = 0.0f;
        for (int lane = 0; lane < 8; ++lane) to[k] += values[k][lane];
    }
#endif
}

// Folds more than eight lanes onto eight by addition; pads fewer with zeros.
inline Eight as_eight(Floats values) {
#if defined(WIDE)
    return (Eight)_mm256_add_ps(_mm512_castps512_ps256((__m512)values), _mm512_extractf32x8_ps((__m512)values, 1));
#elif defined(__AVX2__)
    return values;
#else
    return Eight{values[0], values[1], values[2], values[3]};
#endif
}

// Gathers the first four floats of rows of ROW floats.
template <int ROW>
inline void pick_four(const float* from, const int32_t* index, Floats& x, Floats& y, Floats& z, Floats& w) {
#if defined(__AVX2__)
    const auto row = [&](int lane) { return _mm_loadu_ps(from + ROW * static_cast<int64_t>(index[lane])); };
#endif
#if defined(WIDE)
    const auto four = [&](int lane) {
        __m512 rows = _mm512_castps128_ps512(row(lane));
        rows = _mm512_mask_broadcast_f32x4(rows, 0x00F0, row(lane + 4));
        rows = _mm512_mask_broadcast_f32x4(rows, 0x0F00, row(lane + 8));
        return _mm512_mask_broadcast_f32x4(rows, 0xF000, row(lane + 12));
    };
    const __m512 a = four(0), b = four(1), c = four(2), d = four(3);
    const __m512 xy_ab = _mm512_unpacklo_ps(a, b), zw_ab = _mm512_unpackhi_ps(a, b);
    const __m512 xy_cd = _mm512_unpacklo_ps(c, d), zw_cd = _mm512_unpackhi_ps(c, d);
    x = (Floats)_mm512_shuffle_ps(xy_ab, xy_cd, 0x44);
    y = (Floats)_mm512_shuffle_ps(xy_ab, xy_cd, 0xEE);
    z = (Floats)_mm512_shuffle_ps(zw_ab, zw_cd, 0x44);
    w = (Floats)_mm512_shuffle_ps(zw_ab, zw_cd, 0xEE);
#elif defined(__AVX2__)
    const auto two = [&](int lane) { return _mm256_insertf128_ps(_mm256_castps128_ps256(row(lane)), row(lane + 4), 1); };
    const __m256 a = two(0), b = two(1), c = two(2), d = two(3);
    const __m256 xy_ab = _mm256_unpacklo_ps(a, b), zw_ab = _mm256_unpackhi_ps(a, b);
    const __m256 xy_cd = _mm256_unpacklo_ps(c, d), zw_cd = _mm256_unpackhi_ps(c, d);
    x = (Floats)_mm256_shuffle_ps(xy_ab, xy_cd, 0x44);
    y = (Floats)_mm256_shuffle_ps(xy_ab, xy_cd, 0xEE);
    z = (Floats)_mm256_shuffle_ps(zw_ab, zw_cd, 0x44);
    w = (Floats)_mm256_shuffle_ps(zw_ab, zw_cd, 0xEE);
#else
    for (int lane = 0; lane < LANES; ++lane) {
        const float* row = from + ROW * static_cast<int64_t>(index[lane]);
        x[lane] = row[0], y[lane] = row[1], z[lane] = row[2], w[lane] = row[3];
    }
#endif
}

// Gathers the fourth float of rows of ROW floats.
template <int ROW>
inline Floats fourth(const float* from, const int32_t* index) {
    Floats x, y, z, w;
    pick_four<ROW>(from, index, x, y, z, w);
    return w;
}

#if defined(__AVX2__) && !defined(__AVX512VL__)
// For every lane mask the permutation that moves its lanes to the front.
struct Fronts {
    int32_t lanes[1 << LANES][LANES];
    constexpr Fronts() : lanes{} {
        for (int set = 0; set < 1 << LANES; ++set)
            for (int lane = 0, at = 0; lane < LANES; ++lane)
                if (set >> lane & 1) lanes[set][at++] = lane;
    }
};
alignas(64) constexpr Fronts FRONTS{};
#endif

// Appends the lanes of a mask to a list of `length` entries, which must have room for LANES more. Returns the new length.
inline int64_t append(int32_t* to, int64_t length, Ints set, Ints index) {
#if defined(WIDE)
    const __mmask16 mask = _mm512_movepi32_mask((__m512i)set);
    _mm512_storeu_si512(to + length, _mm512_maskz_compress_epi32(mask, (__m512i)index));
    return length + __builtin_popcount(mask);
#elif defined(__AVX512VL__)
    const __mmask8 mask = _mm256_movepi32_mask((__m256i)set);
    store(to + length, _mm256_maskz_compress_epi32(mask, (__m256i)index));
    return length + __builtin_popcount(mask);
#elif defined(__AVX2__)
    const auto mask = static_cast<unsigned>(_mm256_movemask_ps((__m256)set));
    store(to + length, _mm256_permutevar8x32_epi32((__m256i)index, (__m256i)load_ints(FRONTS.lanes[mask])));
    return length + _mm_popcnt_u32(mask);
#else
    for (int lane = 0; lane < LANES; ++lane) {
        to[length] = index[lane];
        length += set[lane] & 1;
    }
    return length;
#endif
}

}  // namespace
}  // namespace ISA
