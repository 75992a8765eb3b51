// Solids that a network knows, compiled once a isa.
#pragma once

#include "sdf/field.hpp"
#include "isa/lanes.hpp"
#include "sdf/tree.hpp"

namespace ISA {
namespace {

using surfsup::Field;
using surfsup::FieldLayer;
using surfsup::LeafLook;
using surfsup::Lattice;

// Sine and cosine to 2e-7 of arguments up to some thousands; of those beyond some millions no more than that they are bounded.
inline void sine_and_cosine(Floats x, Floats& sine, Floats& cosine) {
    const Floats quarters = rounded(x * 0.636619772f);
    Floats rest = ((x - quarters * 1.5703125f) - quarters * 4.837512969970703125e-4f) - quarters * 7.549789948768648e-8f;
    rest = at_least(at_most(rest, 0.8f), -0.8f);
    const Floats square = rest * rest;  // Cephes sinf, cosf
    const Floats s = rest + rest * square * (-1.6666654611e-1f + square * (8.3321608736e-3f - square * 1.9515295891e-4f));
    const Floats c = 1.0f - 0.5f * square +
                     square * square * (4.166664568298827e-2f + square * (-1.388731625493765e-3f + square * 2.443315711809948e-5f));
    const Ints turned = __builtin_convertvector(quarters, Ints);
    const Ints swapped = (turned & 1) != 0;
    const Floats upright = swapped ? c : s, across = swapped ? s : c;
    sine = (turned & 2) != 0 ? -upright : upright;
    cosine = ((turned + 1) & 2) != 0 ? -across : across;
}

constexpr int ABREAST = 3;   // vectors of points that go through a network side by side, at most
constexpr int TOGETHER = 4;  // channels that are made of them in one go: 4 x 3 sums fit 16 registers

// For every channel the sum over `inputs` of weights times rows of VECTORS vectors; `use` takes each vector of it:
// (channel, vector, sum). From one channel's weight to the next one's it is `to_channel` floats, from one input's `to_input`.
template <int VECTORS, typename Use>
__attribute__((noinline)) void sum_rows(const float* weights, int64_t to_channel, int64_t to_input, int channels, int inputs,
                                        const float* rows, Use use) {
    constexpr int ROW = VECTORS * LANES;
    int channel = 0;
    for (; channel + TOGETHER <= channels; channel += TOGETHER) {
        const float* from = weights + channel * to_channel;
        Floats sums[TOGETHER][VECTORS] = {};
        for (int k = 0; k < inputs; ++k) {
            Floats values[VECTORS];
#pragma GCC unroll 3
            for (int v = 0; v < VECTORS; ++v) values[v] = load(rows + k * ROW + v * LANES);
#pragma GCC unroll 4
            for (int c = 0; c < TOGETHER; ++c) {
                const Floats weight = splat(from[c * to_channel + k * to_input]);
#pragma GCC unroll 3
                for (int v = 0; v < VECTORS; ++v) sums[c][v] += weight * values[v];
            }
        }
#pragma GCC unroll 4
        for (int c = 0; c < TOGETHER; ++c)
#pragma GCC unroll 3
            for (int v = 0; v < VECTORS; ++v) use(channel + c, v, sums[c][v]);
    }
    for (; channel < channels; ++channel) {
        Floats sums[VECTORS] = {};
        for (int k = 0; k < inputs; ++k)
            for (int v = 0; v < VECTORS; ++v)
                sums[v] += splat(weights[channel * to_channel + k * to_input]) * load(rows + k * ROW + v * LANES);
        for (int v = 0; v < VECTORS; ++v) use(channel, v, sums[v]);
    }
}

// The rows (features) of what is told of the places in the first three of them.
template <int VECTORS>
inline void write_octaves(const Field& field, float* rows) {
    constexpr int ROW = VECTORS * LANES;
    float pace = 3.14159265f;
    for (int octave = 0; octave < field.octaves; ++octave, pace *= 2.0f)
        for (int at = 0; at < 3 * ROW; at += LANES) {
            Floats sine, cosine;
            sine_and_cosine(pace * load(rows + at), sine, cosine);
            store(rows + (3 + 6 * octave) * ROW + at, sine);
            store(rows + (6 + 6 * octave) * ROW + at, cosine);
        }
}

// From the gradient in what is told of the places to that in the places, in its first three rows.
template <int VECTORS>
inline void through_octaves(const Field& field, const float* rows, float* gradient) {
    constexpr int ROW = VECTORS * LANES;
    float pace = 3.14159265f;
    for (int octave = 0; octave < field.octaves; ++octave, pace *= 2.0f) {
        const int sines = (3 + 6 * octave) * ROW, cosines = (6 + 6 * octave) * ROW;
        for (int at = 0; at < 3 * ROW; at += LANES)
            store(gradient + at, load(gradient + at) + pace * (load(gradient + sines + at) * load(rows + cosines + at) -
                                                               load(gradient + cosines + at) * load(rows + sines + at)));
    }
}

inline int64_t field_scratch(const Field& field) {
    const int64_t row = ABREAST * LANES;
    return row * (2 * field.features() + static_cast<int64_t>(field.width) * (2 + field.layer_count));
}

// Value and gradient of VECTORS vectors of points, whose places are the first three rows in `scratch`; the gradient takes
// their place.
template <int VECTORS>
void ask_network(const Field& field, float* scratch, Floats (&value)[VECTORS], bool with_gradient) {
    constexpr int ROW = VECTORS * LANES;
    const int width = field.width, features = field.features();
    float *places = scratch, *into_places = places + features * ROW, *one = into_places + features * ROW;
    float *other = one + width * ROW, *slopes = other + width * ROW;
    write_octaves<VECTORS>(field, places);
    for (int number = 0; number < field.layer_count; ++number) {
        const FieldLayer& layer = field.layers[number];
        float* slope = slopes + static_cast<int64_t>(number) * width * ROW;
        const auto begin = [&](int channel, int v, Floats sum) {
            store(other + channel * ROW + v * LANES, sum + layer.bias[channel]);
        };
        const auto add = [&](int channel, int v, Floats sum) {
            float* to = other + channel * ROW + v * LANES;
            store(to, load(to) + sum);
        };
        if (layer.hidden) sum_rows<VECTORS>(layer.hidden, width, 1, width, width, one, begin);
        if (layer.entering && !layer.hidden) sum_rows<VECTORS>(layer.entering, features, 1, width, features, places, begin);
        if (layer.entering && layer.hidden) sum_rows<VECTORS>(layer.entering, features, 1, width, features, places, add);
        for (int at = 0; at < width * ROW; at += LANES) {
            const Floats argument = load(other + at);
            if (field.frequency > 0.0f) {
                Floats sine, cosine;
                sine_and_cosine(field.frequency * argument, sine, cosine);
                store(other + at, sine);
                if (with_gradient) store(slope + at, field.frequency * cosine);
            } else {
                store(other + at, argument < 0.0f ? Floats{} : argument);  // no number stays none
                if (with_gradient) store(slope + at, argument > 0.0f ? splat(1.0f) : Floats{});
            }
        }
        float* last = one;
        one = other, other = last;
    }
    for (int v = 0; v < VECTORS; ++v) value[v] = splat(field.last_bias);
    for (int channel = 0; channel < width; ++channel)
        for (int v = 0; v < VECTORS; ++v) value[v] += field.last[channel] * load(one + channel * ROW + v * LANES);
    if (!with_gradient) return;
    std::memset(into_places, 0, 4 * static_cast<size_t>(features) * ROW);
    for (int number = field.layer_count - 1; number >= 0; --number) {
        const FieldLayer& layer = field.layers[number];
        const float* slope = slopes + static_cast<int64_t>(number) * width * ROW;
        const bool first = number == field.layer_count - 1;
        for (int channel = 0; channel < width; ++channel)
            for (int at = channel * ROW; at < (channel + 1) * ROW; at += LANES)
                store(one + at, (first ? splat(field.last[channel]) : load(other + at)) * load(slope + at));
        if (layer.entering)
            sum_rows<VECTORS>(layer.entering, 1, features, features, width, one, [&](int channel, int v, Floats sum) {
                float* to = into_places + channel * ROW + v * LANES;
                store(to, load(to) + sum);
            });
        if (number > 0)
            sum_rows<VECTORS>(layer.hidden, 1, width, width, width, one, [&](int channel, int v, Floats sum) {
                store(other + channel * ROW + v * LANES, sum);
            });
    }
    through_octaves<VECTORS>(field, places, into_places);
    std::memcpy(places, into_places, 4 * 3 * ROW);
}

// The network's word on the points (…, 3) in a list, in the columns of the same numbers.
template <int VECTORS>
inline void ask_points(const Field& field, const float* points, const int32_t* list, int count, const LeafLook& to, float* scratch) {
    constexpr int ROW = VECTORS * LANES;
    for (int k = 0; k < ROW; ++k)
        for (int axis = 0; axis < 3; ++axis) scratch[axis * ROW + k] = points[3 * static_cast<int64_t>(list[k < count ? k : 0]) + axis];
    Floats value[VECTORS];
    ask_network<VECTORS>(field, scratch, value, to.with_normal);
    for (int k = 0; k < count; ++k) {
        to.rows[list[k]] = value[k / LANES][k % LANES];
        if (to.with_normal)
            for (int axis = 0; axis < 3; ++axis) to.rows[(1 + axis) * to.room + list[k]] = scratch[axis * ROW + k];
    }
}

typedef float Four __attribute__((vector_size(16)));

// Distance and gradient at one point, see lattice.py.
inline void look_in(const Lattice& lattice, const float* point, float& distance, float* gradient) {
    const int64_t along_y = lattice.nodes[2], along_x = static_cast<int64_t>(lattice.nodes[1]) * lattice.nodes[2];
    float border[3], share[3][2];
    int64_t first[3];
    bool beyond = false;
    for (int axis = 0; axis < 3; ++axis) {
        const float lower = lattice.lower[axis], upper = lattice.upper(axis), place = point[axis];
        border[axis] = place < lower ? lower : place > upper ? upper : place;
        beyond = beyond || border[axis] != place;
        const float steps = (border[axis] - lower) / lattice.cell, last = static_cast<float>(lattice.nodes[axis] - 2);
        first[axis] = static_cast<int64_t>(steps < last ? steps : last);  // of what is no number the last
        share[axis][1] = steps - static_cast<float>(first[axis]);
        share[axis][0] = 1.0f - share[axis][1];
    }
    const float* corner = lattice.table + 4 * (first[0] * along_x + first[1] * along_y + first[2]);
    Four mean = {};
    for (int x = 0; x < 2; ++x)
        for (int y = 0; y < 2; ++y)
            for (int z = 0; z < 2; ++z) {
                Four node;
                std::memcpy(&node, corner + 4 * (x * along_x + y * along_y + z), sizeof node);
                mean += share[0][x] * share[1][y] * share[2][z] * node;
            }
    distance = mean[0] + 0.5f * (border[0] * mean[1] + border[1] * mean[2] + border[2] * mean[3]);
    for (int axis = 0; axis < 3; ++axis) gradient[axis] = mean[1 + axis];
    if (!beyond) return;
    const float steep = __builtin_sqrtf(mean[1] * mean[1] + mean[2] * mean[2] + mean[3] * mean[3]);
    const float scale = distance / (steep > 1e-12f ? steep : 1e-12f);
    float square = 0.0f;
    for (int axis = 0; axis < 3; ++axis) {
        gradient[axis] = point[axis] - border[axis] + scale * mean[1 + axis];
        square += gradient[axis] * gradient[axis];
    }
    distance = __builtin_sqrtf(square);
}

// Distance and unit normal of points (count, 3): by the network near the solid, by the lattice elsewhere.
void ask_field(const Field& field, const float* points, int32_t count, const LeafLook& to, int32_t* list, float* scratch) {
    int32_t near = 0;
    const int64_t room = to.room;
    for (int32_t i = 0; i < count; ++i) {
        if (field.lattice.table) {
            float gradient[3];
            look_in(field.lattice, points + 3 * static_cast<int64_t>(i), to.rows[i], gradient);
            if (to.with_normal)
                for (int axis = 0; axis < 3; ++axis) to.rows[(1 + axis) * room + i] = gradient[axis];
            if (!(to.rows[i] < field.near && -to.rows[i] < field.near)) continue;
        }
        list[near++] = i;
    }
    for (int32_t done = 0; done < near;) {
        const int32_t left = near - done;
        if (left > 2 * LANES)
            ask_points<3>(field, points, list + done, left < 3 * LANES ? left : 3 * LANES, to, scratch), done += 3 * LANES;
        else if (left > LANES)
            ask_points<2>(field, points, list + done, left, to, scratch), done += 2 * LANES;
        else
            ask_points<1>(field, points, list + done, left, to, scratch), done += LANES;
    }
    if (!to.with_normal) return;
    for (int32_t i = 0; i < count; ++i) {
        float *x = to.rows + room + i, *y = x + room, *z = y + room;
        const float size = __builtin_sqrtf(*x * *x + *y * *y + *z * *z), scale = 1.0f / (size > 1e-12f ? size : 1e-12f);
        *x *= scale, *y *= scale, *z *= scale;
    }
}

}  // namespace
}  // namespace ISA
