// Neural signed distance fields, compiled once for every instruction set.
#pragma once

#include "isa/lanes.hpp"
#include "sdf/csg_tree.hpp"
#include "sdf/neural_field.hpp"

namespace ISA {
namespace {

using surfsup::interpolate_table;
using surfsup::NeuralField;
using surfsup::NeuralLayer;
using surfsup::Samples;
using surfsup::SdfGrid;
using surfsup::upper_corner;
using surfsup::Vector4;

// Sine and cosine with an error of 2e-7 for arguments up to some thousands. Results stay bounded for any larger argument.
inline void sine_and_cosine(Floats x, Floats& sine, Floats& cosine) {
    const Floats quarter_turns = rounded(x * 0.636619772f);
    Floats rest =
        ((x - quarter_turns * 1.5703125f) - quarter_turns * 4.837512969970703125e-4f) - quarter_turns * 7.549789948768648e-8f;
    rest = at_least(at_most(rest, 0.8f), -0.8f);
    const Floats square = rest * rest;  // Cephes sinf, cosf
    const Floats s = rest + rest * square * (-1.6666654611e-1f + square * (8.3321608736e-3f - square * 1.9515295891e-4f));
    const Floats c =
        1.0f - 0.5f * square +
        square * square * (4.166664568298827e-2f + square * (-1.388731625493765e-3f + square * 2.443315711809948e-5f));
    const Ints quadrant = __builtin_convertvector(quarter_turns, Ints);
    const Ints swapped = (quadrant & 1) != 0;
    const Floats unsigned_sine = swapped ? c : s, unsigned_cosine = swapped ? s : c;
    sine = (quadrant & 2) != 0 ? -unsigned_sine : unsigned_sine;
    cosine = ((quadrant + 1) & 2) != 0 ? -unsigned_cosine : unsigned_cosine;
}

constexpr int MAX_VECTORS = 3;    // vectors of points that pass through a network side by side
constexpr int CHANNEL_BLOCK = 4;  // channels computed at once: 4 x 3 sums fit 16 registers

// For every channel, the sum over `inputs` of weights times rows of VECTORS vectors. Calls `use(channel, vector, sum)` for each
// vector of a sum. The weights of successive channels are `channel_stride` floats apart, those of successive inputs
// `input_stride`.
template <int VECTORS, typename Use>
__attribute__((noinline)) void sum_rows(const float* weights, int64_t channel_stride, int64_t input_stride, int channels,
                                        int inputs, const float* rows, Use use) {
    constexpr int ROW = VECTORS * LANES;
    int channel = 0;
    for (; channel + CHANNEL_BLOCK <= channels; channel += CHANNEL_BLOCK) {
        const float* from = weights + channel * channel_stride;
        Floats sums[CHANNEL_BLOCK][VECTORS] = {};
        for (int k = 0; k < inputs; ++k) {
            Floats values[VECTORS];
#pragma GCC unroll 3
            for (int v = 0; v < VECTORS; ++v) values[v] = load(rows + k * ROW + v * LANES);
#pragma GCC unroll 4
            for (int c = 0; c < CHANNEL_BLOCK; ++c) {
                const Floats weight = splat(from[c * channel_stride + k * input_stride]);
#pragma GCC unroll 3
                for (int v = 0; v < VECTORS; ++v) sums[c][v] += weight * values[v];
            }
        }
#pragma GCC unroll 4
        for (int c = 0; c < CHANNEL_BLOCK; ++c)
#pragma GCC unroll 3
            for (int v = 0; v < VECTORS; ++v) use(channel + c, v, sums[c][v]);
    }
    for (; channel < channels; ++channel) {
        Floats sums[VECTORS] = {};
        for (int k = 0; k < inputs; ++k)
            for (int v = 0; v < VECTORS; ++v)
                sums[v] += splat(weights[channel * channel_stride + k * input_stride]) * load(rows + k * ROW + v * LANES);
        for (int v = 0; v < VECTORS; ++v) use(channel, v, sums[v]);
    }
}

inline int input_count(const NeuralField& field) { return 3 + 6 * field.octaves; }

// Appends the sines and cosines of the octaves to the positions in the first three rows.
template <int VECTORS>
inline void write_octaves(const NeuralField& field, float* rows) {
    constexpr int ROW = VECTORS * LANES;
    float frequency = 3.14159265f;
    for (int octave = 0; octave < field.octaves; ++octave, frequency *= 2.0f)
        for (int at = 0; at < 3 * ROW; at += LANES) {
            Floats sine, cosine;
            sine_and_cosine(frequency * load(rows + at), sine, cosine);
            store(rows + (3 + 6 * octave) * ROW + at, sine);
            store(rows + (6 + 6 * octave) * ROW + at, cosine);
        }
}

// Turns the gradient in the inputs into that in the positions, in the first three rows.
template <int VECTORS>
inline void backpropagate_octaves(const NeuralField& field, const float* rows, float* gradient) {
    constexpr int ROW = VECTORS * LANES;
    float frequency = 3.14159265f;
    for (int octave = 0; octave < field.octaves; ++octave, frequency *= 2.0f) {
        const int sines = (3 + 6 * octave) * ROW, cosines = (6 + 6 * octave) * ROW;
        for (int at = 0; at < 3 * ROW; at += LANES)
            store(gradient + at, load(gradient + at) + frequency * (load(gradient + sines + at) * load(rows + cosines + at) -
                                                                    load(gradient + cosines + at) * load(rows + sines + at)));
    }
}

inline int64_t field_scratch_size(const NeuralField& field) {
    const int64_t row = MAX_VECTORS * LANES;
    return row * (2 * input_count(field) + static_cast<int64_t>(field.width) * (2 + field.layer_count));
}

// Value and gradient at VECTORS vectors of points, whose positions are the first three rows of `scratch`. The gradient replaces
// them.
template <int VECTORS>
void evaluate_network(const NeuralField& field, float* scratch, Floats (&value)[VECTORS], bool with_gradient) {
    constexpr int ROW = VECTORS * LANES;
    const int width = field.width, inputs = input_count(field);
    float *input = scratch, *input_gradient = input + inputs * ROW, *current = input_gradient + inputs * ROW;
    float *next = current + width * ROW, *slopes = next + width * ROW;
    write_octaves<VECTORS>(field, input);
    for (int number = 0; number < field.layer_count; ++number) {
        const NeuralLayer& layer = field.layers[number];
        float* slope = slopes + static_cast<int64_t>(number) * width * ROW;
        const auto begin = [&](int channel, int v, Floats sum) {
            store(next + channel * ROW + v * LANES, sum + layer.bias[channel]);
        };
        const auto add = [&](int channel, int v, Floats sum) {
            float* to = next + channel * ROW + v * LANES;
            store(to, load(to) + sum);
        };
        if (layer.hidden) sum_rows<VECTORS>(layer.hidden, width, 1, width, width, current, begin);
        if (layer.input && !layer.hidden) sum_rows<VECTORS>(layer.input, inputs, 1, width, inputs, input, begin);
        if (layer.input && layer.hidden) sum_rows<VECTORS>(layer.input, inputs, 1, width, inputs, input, add);
        for (int at = 0; at < width * ROW; at += LANES) {
            const Floats argument = load(next + at);
            if (field.frequency > 0.0f) {
                Floats sine, cosine;
                sine_and_cosine(field.frequency * argument, sine, cosine);
                store(next + at, sine);
                if (with_gradient) store(slope + at, field.frequency * cosine);
            } else {
                store(next + at, argument < 0.0f ? Floats{} : argument);  // NaN stays NaN
                if (with_gradient) store(slope + at, argument > 0.0f ? splat(1.0f) : Floats{});
            }
        }
        float* previous = current;
        current = next, next = previous;
    }
    for (int v = 0; v < VECTORS; ++v) value[v] = splat(field.last_bias);
    for (int channel = 0; channel < width; ++channel)
        for (int v = 0; v < VECTORS; ++v) value[v] += field.last[channel] * load(current + channel * ROW + v * LANES);
    if (!with_gradient) return;
    std::memset(input_gradient, 0, 4 * static_cast<size_t>(inputs) * ROW);
    for (int number = field.layer_count - 1; number >= 0; --number) {
        const NeuralLayer& layer = field.layers[number];
        const float* slope = slopes + static_cast<int64_t>(number) * width * ROW;
        const bool first = number == field.layer_count - 1;
        for (int channel = 0; channel < width; ++channel)
            for (int at = channel * ROW; at < (channel + 1) * ROW; at += LANES)
                store(current + at, (first ? splat(field.last[channel]) : load(next + at)) * load(slope + at));
        if (layer.input)
            sum_rows<VECTORS>(layer.input, 1, inputs, inputs, width, current, [&](int channel, int v, Floats sum) {
                float* to = input_gradient + channel * ROW + v * LANES;
                store(to, load(to) + sum);
            });
        if (number > 0)
            sum_rows<VECTORS>(layer.hidden, 1, width, width, width, current,
                              [&](int channel, int v, Floats sum) { store(next + channel * ROW + v * LANES, sum); });
    }
    backpropagate_octaves<VECTORS>(field, input, input_gradient);
    std::memcpy(input, input_gradient, 4 * 3 * ROW);
}

// Evaluates the network at the points with `indices` (count) and writes their columns of the samples.
template <int VECTORS>
inline void evaluate_points(const NeuralField& field, const float* points, const int32_t* indices, int count,
                            const Samples& samples, float* scratch) {
    constexpr int ROW = VECTORS * LANES;
    for (int k = 0; k < ROW; ++k)
        for (int axis = 0; axis < 3; ++axis)
            scratch[axis * ROW + k] = points[3 * static_cast<int64_t>(indices[k < count ? k : 0]) + axis];
    Floats value[VECTORS];
    evaluate_network<VECTORS>(field, scratch, value, samples.with_normal);
    for (int k = 0; k < count; ++k) {
        samples.rows[indices[k]] = value[k / LANES][k % LANES];
        if (samples.with_normal)
            for (int axis = 0; axis < 3; ++axis)
                samples.rows[(1 + axis) * samples.stride + indices[k]] = scratch[axis * ROW + k];
    }
}

// Signed distance and gradient at a point, see surfsup.sdf.grid.SdfGrid.sample.
inline void sample_grid(const SdfGrid<float>& grid, const float* point, float& distance, float* gradient) {
    float border[3];
    bool beyond = false;
    for (size_t axis = 0; axis < 3; ++axis) {
        const float lower = grid.lower[axis], upper = upper_corner(grid, axis), position = point[axis];
        border[axis] = position < lower ? lower : position > upper ? upper : position;
        beyond = beyond || border[axis] != position;
    }
    const Vector4 mean = interpolate_table(grid, border);
    const float x = border[0] - grid.center[0], y = border[1] - grid.center[1], z = border[2] - grid.center[2];
    distance = mean[0] + 0.5f * (x * mean[1] + y * mean[2] + z * mean[3]);
    for (int axis = 0; axis < 3; ++axis) gradient[axis] = mean[1 + axis];
    if (!beyond) return;
    const float slope = __builtin_sqrtf(mean[1] * mean[1] + mean[2] * mean[2] + mean[3] * mean[3]);
    const float scale = distance / (slope > 1e-12f ? slope : 1e-12f);
    float squared = 0.0f;
    for (int axis = 0; axis < 3; ++axis) {
        gradient[axis] = point[axis] - border[axis] + scale * mean[1 + axis];
        squared += gradient[axis] * gradient[axis];
    }
    distance = __builtin_sqrtf(squared);
}

// Signed distance and unit normal of points (count, 3), by the network near the surface and by the grid elsewhere.
void sample_field(const NeuralField& field, const float* points, int32_t count, const Samples& samples, int32_t* indices,
                  float* scratch) {
    int32_t near = 0;
    const int64_t stride = samples.stride;
    for (int32_t i = 0; i < count; ++i) {
        if (field.grid.table) {
            float gradient[3];
            sample_grid(field.grid, points + 3 * static_cast<int64_t>(i), samples.rows[i], gradient);
            if (samples.with_normal)
                for (int axis = 0; axis < 3; ++axis) samples.rows[(1 + axis) * stride + i] = gradient[axis];
            if (!(samples.rows[i] < field.network_range && -samples.rows[i] < field.network_range)) continue;
        }
        indices[near++] = i;
    }
    for (int32_t done = 0; done < near;) {
        const int32_t left = near - done;
        if (left > 2 * LANES)
            evaluate_points<3>(field, points, indices + done, left < 3 * LANES ? left : 3 * LANES, samples, scratch),
                done += 3 * LANES;
        else if (left > LANES)
            evaluate_points<2>(field, points, indices + done, left, samples, scratch), done += 2 * LANES;
        else
            evaluate_points<1>(field, points, indices + done, left, samples, scratch), done += LANES;
    }
    if (!samples.with_normal) return;
    for (int32_t i = 0; i < count; ++i) {
        float *x = samples.rows + stride + i, *y = x + stride, *z = y + stride;
        const float length = __builtin_sqrtf(*x * *x + *y * *y + *z * *z), scale = 1.0f / (length > 1e-12f ? length : 1e-12f);
        *x *= scale, *y *= scale, *z *= scale;
    }
}

}  // namespace
}  // namespace ISA
