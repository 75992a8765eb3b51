// A tile of rows through a perceptron and back, compiled once for every instruction set.
#pragma once

#include "learned/message_passing_data.hpp"
#include "learned/products_isa.hpp"

namespace ISA {
namespace {

using surfsup::DEPTH_UNIT;
using surfsup::padded;
using surfsup::Perceptron;
using surfsup::PerceptronGradient;
using surfsup::ROW_TILE;
using surfsup::WIDTH_UNIT;

// Memory of a thread for one tile. A tile has `stride` of ROW_TILE rows of the widest matrix.
template <typename First, typename Number>
struct Tile {
    float* sums;                   // of products, and gradients
    typename First::Value* input;  // (rows, padded depth)
    typename Number::Value *hidden_1, *hidden_2, *normalized, *gradient;
    typename First::Value* first_gradient;
    float *room, *other_room;
    float* inverse_std;

    Tile(const Perceptron& perceptron, float* scratch) {
        const int64_t widest = perceptron.depth > perceptron.width ? padded(perceptron.depth, WIDTH_UNIT) : perceptron.width;
        const auto take = [&](auto*& piece) {
            piece = reinterpret_cast<std::remove_reference_t<decltype(piece)>>(scratch);
            scratch += ROW_TILE * widest;
        };
        take(sums), take(input), take(hidden_1), take(hidden_2), take(normalized), take(gradient), take(first_gradient);
        take(room), take(other_room);
        inverse_std = scratch;
    }
};

// Values after a ReLU in another precision.
template <typename Number>
inline void rectify(const float* sums, int64_t count, typename Number::Value* to) {
    for (int64_t k = 0; k < count; k += LANES) Number::store(to + k, at_least(load(sums + k), 0.0f));
}

// LayerNorm of a tile in place, without its scale and shift.
inline void normalize(float* rows, int count, int width, float epsilon, float* inverse_std) {
    const float share = 1.0f / static_cast<float>(width);
    for (int row = 0; row < count; ++row) {
        float* values = rows + row * width;
        Floats total = {};
        for (int k = 0; k < width; k += LANES) total += load(values + k);
        const Floats mean = splat(sum(total) * share);
        Floats squares = {};
        for (int k = 0; k < width; k += LANES) {
            const Floats difference = load(values + k) - mean;
            squares += difference * difference;
        }
        const float inverse = 1.0f / __builtin_sqrtf(sum(squares) * share + epsilon);
        inverse_std[row] = inverse;
        for (int k = 0; k < width; k += LANES) store(values + k, (load(values + k) - mean) * inverse);
    }
}

// All layers after the first product. Takes that product, with its bias, from `sums` and leaves the normalized output there.
template <typename First, typename Number>
inline void finish_forward(const Perceptron& perceptron, Tile<First, Number>& tile, int rows) {
    const int width = perceptron.width;
    const int64_t count = static_cast<int64_t>(rows) * width;
    rectify<Number>(tile.sums, count, tile.hidden_1);
    multiply_tile<Number>(tile.hidden_1, rows, width, perceptron.hidden, width, perceptron.hidden_bias, 0, tile.sums);
    rectify<Number>(tile.sums, count, tile.hidden_2);
    multiply_tile<Number>(tile.hidden_2, rows, width, perceptron.output, width, perceptron.output_bias, 0, tile.sums);
    normalize(tile.sums, rows, width, perceptron.epsilon, tile.inverse_std);
}

inline void add(float* to, Floats values) { store(to, load(to) + values); }

// Turns the gradient of the perceptron's output in `sums` into that of its last product, in `gradient`.
template <typename First, typename Number>
inline void layer_norm_backward(const Perceptron& perceptron, const PerceptronGradient& sum_of, Tile<First, Number>& tile,
                                int rows) {
    const int width = perceptron.width;
    const float share = 1.0f / static_cast<float>(width);
    for (int row = 0; row < rows; ++row) {
        const float* gradient = tile.sums + row * width;
        const typename Number::Value* normalized = tile.normalized + row * width;
        Floats plain = {}, along = {};
        for (int k = 0; k < width; k += LANES) {
            const Floats value = load(gradient + k), unit = Number::load(normalized + k);
            const Floats scaled = value * load(perceptron.scale + k);
            plain += scaled;
            along += scaled * unit;
            add(sum_of.shift + k, value);
            add(sum_of.scale + k, value * unit);
        }
        const Floats mean = splat(sum(plain) * share), slope = splat(sum(along) * share);
        const float inverse = tile.inverse_std[row];
        for (int k = 0; k < width; k += LANES) {
            const Floats scaled = load(gradient + k) * load(perceptron.scale + k);
            const Floats result = inverse * (scaled - mean - Number::load(normalized + k) * slope);
            add(sum_of.output_bias + k, result);
            Number::store(tile.gradient + row * width + k, result);
        }
    }
}

// Gradients in `sums` through the ReLU with this output, in another precision; their sum over the rows is a bias' gradient.
template <typename Number, typename Output>
inline void rectify_backward(const float* sums, const typename Output::Value* output, int rows, int width, float* bias_gradient,
                             typename Number::Value* to) {
    for (int k = 0; k < width; k += LANES) {
        Floats total = {};
        for (int row = 0; row < rows; ++row) {
            const int64_t at = static_cast<int64_t>(row) * width + k;
            const Floats value = Output::load(output + at) > 0.0f ? load(sums + at) : Floats{};
            total += value;
            Number::store(to + at, value);
        }
        if (bias_gradient) add(bias_gradient + k, total);
    }
}

// All layers but the first product. Takes the gradient of the perceptron's output from `sums` and leaves that of the first
// product in `first_gradient`.
template <typename First, typename Number>
inline void finish_backward(const Perceptron& perceptron, const PerceptronGradient& sum_of, Tile<First, Number>& tile,
                            int rows) {
    using Value = typename Number::Value;
    const int width = perceptron.width;
    auto *room = reinterpret_cast<Value*>(tile.room), *other = reinterpret_cast<Value*>(tile.other_room);
    layer_norm_backward(perceptron, sum_of, tile, rows);
    add_outer_product<Number>(tile.hidden_2, tile.gradient, rows, width, width, sum_of.output, room, other);
    multiply_tile<Number>(tile.gradient, rows, width, perceptron.output_transposed, width, perceptron.no_bias, 0, tile.sums);
    rectify_backward<Number, Number>(tile.sums, tile.hidden_2, rows, width, sum_of.hidden_bias, tile.gradient);
    add_outer_product<Number>(tile.hidden_1, tile.gradient, rows, width, width, sum_of.hidden, room, other);
    multiply_tile<Number>(tile.gradient, rows, width, perceptron.hidden_transposed, width, perceptron.no_bias, 0, tile.sums);
    rectify_backward<First, Number>(tile.sums, tile.hidden_1, rows, width, sum_of.first_bias, tile.first_gradient);
}

// Adds the gradient of the first layer's weight, from the input (rows, padded depth).
template <typename First, typename Number>
inline void first_layer_backward(const Perceptron& perceptron, const PerceptronGradient& sum_of, Tile<First, Number>& tile,
                                 const typename First::Value* input, int rows) {
    using Value = typename First::Value;
    add_outer_product<First>(input, tile.first_gradient, rows, padded(perceptron.depth, DEPTH_UNIT), perceptron.width,
                             sum_of.first, reinterpret_cast<Value*>(tile.room), reinterpret_cast<Value*>(tile.other_room));
}

}  // namespace
}  // namespace ISA
