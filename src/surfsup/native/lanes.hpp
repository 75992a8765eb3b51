// A vector of as many floats as this translation unit's instruction set has lanes, and the few functions of it that
// the step needs. It is compiled once a path, each time in that path's own namespace: nothing here may be shared.
#pragma once

#include <cstdint>
#include <cstring>

#if defined(__AVX512F__) || defined(__AVX2__)
#include <immintrin.h>
#endif

namespace PATH {
namespace {

#if defined(__AVX512F__)
constexpr int LANES = 16;
constexpr int ROWS = 12;  // particles in a block of the products: 12 x 2 sums fit the 32 registers
constexpr int AT_ONCE = 2;   // neighbours whose sums are made side by side: 2 x 4 kernels x 2 vectors fit
#elif defined(__AVX2__)
constexpr int LANES = 8;
constexpr int ROWS = 6;     // 6 x 2 sums fit the 16 registers
constexpr int AT_ONCE = 1;  // 4 kernels x 2 vectors fit
#else
constexpr int LANES = 4;
constexpr int ROWS = 6;
constexpr int AT_ONCE = 1;
#endif

typedef float Floats __attribute__((vector_size(4 * LANES)));
typedef int32_t Ints __attribute__((vector_size(4 * LANES)));
typedef float FourFloats __attribute__((vector_size(16)));

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

inline FourFloats load_four(const float* from) {
    FourFloats values;
    std::memcpy(&values, from, sizeof values);
    return values;
}

template <typename Vector>
inline void store(void* to, Vector values) { std::memcpy(to, &values, sizeof values); }

inline Floats square_root(Floats values) {
#if defined(__AVX512F__)
    return (Floats)_mm512_sqrt_ps((__m512)values);
#elif defined(__AVX2__)
    return (Floats)_mm256_sqrt_ps((__m256)values);
#else
    Floats roots = values;
    for (int lane = 0; lane < LANES; ++lane) roots[lane] = __builtin_sqrtf(values[lane]);
    return roots;
#endif
}

// 1 / x to 2e-7 of it, for normal x whose reciprocal is normal too.
inline Floats reciprocal(Floats x) {
#if defined(__AVX512F__)
    const Floats guess = (Floats)_mm512_rcp14_ps((__m512)x);
    return guess * (2.0f - x * guess);  // a step of Newton's
#elif defined(__AVX2__)
    const Floats guess = (Floats)_mm256_rcp_ps((__m256)x);
    return guess * (2.0f - x * guess);
#else
    return 1.0f / x;
#endif
}

// A comparison with NaN is false, so NaN stays NaN in both.
inline Floats at_most(Floats values, float most) { return values > most ? splat(most) : values; }
inline Floats at_least(Floats values, float least) { return values < least ? splat(least) : values; }

inline Floats from_ints(Ints values) { return __builtin_convertvector(values, Floats); }

// Nearest whole number of values that an int can hold, by the rounding of an addition.
inline Floats rounded(Floats values) {
    const Floats shift = splat(12582912.0f);  // 1.5 * 2^23
    return (values + shift) - shift;
}

// e^x to 2e-7 of its size; beyond +-87 as at +-87.
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
#if defined(__AVX512F__)
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

// One number each from a list.
inline Floats pick(const float* from, Ints index) {
#if defined(__AVX512F__)
    return (Floats)_mm512_i32gather_ps((__m512i)index, from, 4);
#elif defined(__AVX2__)
    return (Floats)_mm256_i32gather_ps(from, (__m256i)index, 4);
#else
    Floats values;
    for (int lane = 0; lane < LANES; ++lane) values[lane] = from[index[lane]];
    return values;
#endif
}

// The first three of four numbers each from a list.
inline void pick_three(const float* from, const int32_t* index, Floats& x, Floats& y, Floats& z) {
#if defined(__AVX512F__)
    const Ints four = 4 * load_ints(index);
    x = pick(from, four), y = pick(from + 1, four), z = pick(from + 2, four);
#elif defined(__AVX2__)
    const auto two = [&](int lane) {
        const __m128 low = _mm_loadu_ps(from + 4 * static_cast<int64_t>(index[lane]));
        const __m128 high = _mm_loadu_ps(from + 4 * static_cast<int64_t>(index[lane + 4]));
        return _mm256_insertf128_ps(_mm256_castps128_ps256(low), high, 1);
    };
    const __m256 a = two(0), b = two(1), c = two(2), d = two(3);
    const __m256 xy_ab = _mm256_unpacklo_ps(a, b), z_ab = _mm256_unpackhi_ps(a, b);
    const __m256 xy_cd = _mm256_unpacklo_ps(c, d), z_cd = _mm256_unpackhi_ps(c, d);
    x = (Floats)_mm256_shuffle_ps(xy_ab, xy_cd, 0x44);
    y = (Floats)_mm256_shuffle_ps(xy_ab, xy_cd, 0xEE);
    z = (Floats)_mm256_shuffle_ps(z_ab, z_cd, 0x44);
#else
    for (int lane = 0; lane < LANES; ++lane) {
        const float* row = from + 4 * static_cast<int64_t>(index[lane]);
        x[lane] = row[0], y[lane] = row[1], z[lane] = row[2];
    }
#endif
}

// The lanes of four vectors one after the other: the first of each, the second of each, and so on.
inline void store_four(float* to, Floats a, Floats b, Floats c, Floats d) {
#if defined(__AVX512F__)
    const __m512 low_ab = _mm512_unpacklo_ps((__m512)a, (__m512)b), high_ab = _mm512_unpackhi_ps((__m512)a, (__m512)b);
    const __m512 low_cd = _mm512_unpacklo_ps((__m512)c, (__m512)d), high_cd = _mm512_unpackhi_ps((__m512)c, (__m512)d);
    // Each of four lanes of every 128 bits: lanes 0, 4, 8, 12, then 1, 5, 9, 13, and so on.
    const __m512 first = _mm512_shuffle_ps(low_ab, low_cd, 0x44), second = _mm512_shuffle_ps(low_ab, low_cd, 0xEE);
    const __m512 third = _mm512_shuffle_ps(high_ab, high_cd, 0x44), fourth = _mm512_shuffle_ps(high_ab, high_cd, 0xEE);
    const __m512 p = _mm512_shuffle_f32x4(first, second, 0x44), q = _mm512_shuffle_f32x4(third, fourth, 0x44);
    const __m512 r = _mm512_shuffle_f32x4(first, second, 0xEE), t = _mm512_shuffle_f32x4(third, fourth, 0xEE);
    _mm512_storeu_ps(to, _mm512_shuffle_f32x4(p, q, 0x88));
    _mm512_storeu_ps(to + 16, _mm512_shuffle_f32x4(p, q, 0xDD));
    _mm512_storeu_ps(to + 32, _mm512_shuffle_f32x4(r, t, 0x88));
    _mm512_storeu_ps(to + 48, _mm512_shuffle_f32x4(r, t, 0xDD));
#elif defined(__AVX2__)
    const __m256 low_ab = _mm256_unpacklo_ps((__m256)a, (__m256)b), high_ab = _mm256_unpackhi_ps((__m256)a, (__m256)b);
    const __m256 low_cd = _mm256_unpacklo_ps((__m256)c, (__m256)d), high_cd = _mm256_unpackhi_ps((__m256)c, (__m256)d);
    const __m256 first = _mm256_shuffle_ps(low_ab, low_cd, 0x44), second = _mm256_shuffle_ps(low_ab, low_cd, 0xEE);
    const __m256 third = _mm256_shuffle_ps(high_ab, high_cd, 0x44), fourth = _mm256_shuffle_ps(high_ab, high_cd, 0xEE);
    _mm256_storeu_ps(to, _mm256_permute2f128_ps(first, second, 0x20));
    _mm256_storeu_ps(to + 8, _mm256_permute2f128_ps(third, fourth, 0x20));
    _mm256_storeu_ps(to + 16, _mm256_permute2f128_ps(first, second, 0x31));
    _mm256_storeu_ps(to + 24, _mm256_permute2f128_ps(third, fourth, 0x31));
#else
    for (int lane = 0; lane < LANES; ++lane) {
        to[4 * lane] = a[lane];
        to[4 * lane + 1] = b[lane];
        to[4 * lane + 2] = c[lane];
        to[4 * lane + 3] = d[lane];
    }
#endif
}

// Where other particles are, seen from one: displacement and index; `x` and so on are lists with room.
struct Places {
    float *x, *y, *z;
    int32_t* index;
};

#if defined(__AVX2__) && !defined(__AVX512F__)
// For every set of lanes the order that brings these to the front.
struct Fronts {
    int32_t of[1 << LANES][LANES];
    constexpr Fronts() : of{} {
        for (int set = 0; set < 1 << LANES; ++set)
            for (int lane = 0, at = 0; lane < LANES; ++lane)
                if (set >> lane & 1) of[set][at++] = lane;
    }
};
alignas(64) constexpr Fronts FRONTS{};
#endif

// Appends the lanes that are set to lists of `length`, which must have room for LANES more; returns the new length.
inline int64_t append(const Places& to, int64_t length, Ints set, Floats x, Floats y, Floats z, Ints index) {
#if defined(__AVX512F__)
    const __mmask16 mask = _mm512_movepi32_mask((__m512i)set);
    _mm512_storeu_ps(to.x + length, _mm512_maskz_compress_ps(mask, (__m512)x));
    _mm512_storeu_ps(to.y + length, _mm512_maskz_compress_ps(mask, (__m512)y));
    _mm512_storeu_ps(to.z + length, _mm512_maskz_compress_ps(mask, (__m512)z));
    _mm512_storeu_si512(to.index + length, _mm512_maskz_compress_epi32(mask, (__m512i)index));
    return length + __builtin_popcount(mask);
#elif defined(__AVX2__)
    const auto mask = static_cast<unsigned>(_mm256_movemask_ps((__m256)set));
    const auto front = (__m256i)load_ints(FRONTS.of[mask]);
    store(to.x + length, _mm256_permutevar8x32_ps((__m256)x, front));
    store(to.y + length, _mm256_permutevar8x32_ps((__m256)y, front));
    store(to.z + length, _mm256_permutevar8x32_ps((__m256)z, front));
    store(to.index + length, _mm256_permutevar8x32_epi32((__m256i)index, front));
    return length + _mm_popcnt_u32(mask);
#else
    for (int lane = 0; lane < LANES; ++lane) {
        to.x[length] = x[lane];
        to.y[length] = y[lane];
        to.z[length] = z[lane];
        to.index[length] = index[lane];
        length += set[lane] & 1;
    }
    return length;
#endif
}

}  // namespace
}  // namespace PATH
