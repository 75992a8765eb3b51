// Perceptrons on rows and on edges, tile by tile: no intermediate matrix goes to memory but what the backward pass needs.
// Compiled once for every instruction set.
#pragma once

#include <type_traits>

#include "learned/perceptron_isa.hpp"

namespace ISA {
namespace {

using surfsup::Activations;
using surfsup::EdgePass;
using surfsup::MessagePassingKernels;
using surfsup::RowPass;

template <typename Value, typename Pointer>
inline auto* as(Pointer* pointer) {
    using Target = std::conditional_t<std::is_const_v<Pointer>, const Value, Value>;
    return static_cast<Target*>(pointer);
}

inline int rows_of_tile(int64_t first, int64_t end) {
    return static_cast<int>(end - first < ROW_TILE ? end - first : ROW_TILE);
}

template <typename Value>
inline void copy(const Value* from, int64_t count, Value* to) {
    std::memcpy(to, from, static_cast<size_t>(count) * sizeof(Value));
}

// Requests the memory of the next tile while this one is computed.
template <typename Value>
inline void prefetch(const Value* matrix, int64_t first_row, int width) {
    if (!matrix) return;
    const Value* from = matrix + first_row * width;
    for (int k = 0; k < ROW_TILE * width; k += static_cast<int>(64 / sizeof(Value))) __builtin_prefetch(from + k, 0, 2);
}

// Copies what only the backward pass will read.
template <typename Value>
inline void put_away(const Value* from, int64_t count, Value* to) {
    constexpr int64_t VECTOR = sizeof(Floats) / sizeof(Value);
    if (reinterpret_cast<uintptr_t>(to) % sizeof(Floats) || count % VECTOR) {
        copy(from, count, to);
        return;
    }
    for (int64_t k = 0; k < count; k += VECTOR) {
        Floats bits;
        std::memcpy(&bits, from + k, sizeof bits);
        store_past_caches(reinterpret_cast<float*>(to + k), bits);
    }
}

template <typename First, typename Number>
inline void keep(const Activations& kept, const Tile<First, Number>& tile, int64_t first, int rows, int width) {
    if (!kept.hidden_1) return;
    using Value = typename Number::Value;
    const int64_t at = first * width, count = static_cast<int64_t>(rows) * width;
    for (int64_t k = 0; k < count; k += LANES) Number::store(tile.normalized + k, load(tile.sums + k));
    put_away(tile.hidden_1, count, as<Value>(kept.hidden_1) + at);
    put_away(tile.hidden_2, count, as<Value>(kept.hidden_2) + at);
    put_away(tile.normalized, count, as<Value>(kept.normalized) + at);
    copy(tile.inverse_std, rows, kept.inverse_std + first);
}

template <typename First, typename Number>
inline void recall(const Activations& kept, Tile<First, Number>& tile, int64_t first, int width) {
    using Value = typename Number::Value;
    tile.hidden_1 = as<Value>(kept.hidden_1) + first * width;
    tile.hidden_2 = as<Value>(kept.hidden_2) + first * width;
    tile.normalized = as<Value>(kept.normalized) + first * width;
    tile.inverse_std = kept.inverse_std + first;
}

// Rows of the input in another precision, padded by zeros.
template <typename First, typename Number>
inline void read_rows(const float* rows, int count, int depth, Tile<First, Number>& tile) {
    const int columns = padded(depth, DEPTH_UNIT), whole = depth / LANES * LANES;
    for (int row = 0; row < count; ++row) {
        const float* from = rows + static_cast<int64_t>(row) * depth;
        typename First::Value* to = tile.input + row * columns;
        for (int k = 0; k < whole; k += LANES) First::store(to + k, load(from + k));
        if (whole == columns) continue;
        float rest[LANES] = {};
        typename First::Value converted[LANES];
        copy(from + whole, depth - whole, rest);
        First::store(converted, load(rest));
        copy(converted, columns - whole, to + whole);
    }
}

template <typename First, typename Number>
void rows_forward(const RowPass& pass, int32_t begin, int32_t end, float* scratch) {
    const Perceptron& perceptron = pass.perceptron;
    const int width = perceptron.width, depth = perceptron.depth;
    Tile<First, Number> tile(perceptron, scratch);
    for (int64_t first = begin; first < end; first += ROW_TILE) {
        const int rows = rows_of_tile(first, end);
        read_rows(pass.rows + first * depth, rows, depth, tile);
        multiply_tile<First>(tile.input, rows, padded(depth, DEPTH_UNIT), perceptron.first, width, perceptron.first_bias, 0,
                             tile.sums);
        finish_forward(perceptron, tile, rows);
        keep(pass.kept, tile, first, rows, width);
        for (int row = 0; row < rows; ++row)
            for (int k = 0; k < width; k += LANES) {
                const int64_t at = row * width + k, to = first * width + at;
                const Floats value = load(tile.sums + at) * load(perceptron.scale + k) + load(perceptron.shift + k);
                if (pass.out_float32)
                    store(as<float>(pass.out) + to, value);
                else
                    Number::store(as<typename Number::Value>(pass.out) + to, value);
            }
    }
}

template <typename First, typename Number>
void rows_backward(const RowPass& pass, const PerceptronGradient& sum_of, int32_t begin, int32_t end, float* scratch) {
    const Perceptron& perceptron = pass.perceptron;
    const int width = perceptron.width, depth = perceptron.depth;
    Tile<First, Number> tile(perceptron, scratch);
    for (int64_t first = begin; first < end; first += ROW_TILE) {
        const int rows = rows_of_tile(first, end);
        recall(pass.kept, tile, first, width);
        read_rows(pass.rows + first * depth, rows, depth, tile);
        const int64_t from = first * width;
        for (int64_t k = 0; k < static_cast<int64_t>(rows) * width; k += LANES)
            store(tile.sums + k, pass.out_float32
                                     ? load(as<const float>(pass.out_gradient) + from + k)
                                     : Number::load(as<const typename Number::Value>(pass.out_gradient) + from + k));
        finish_backward(perceptron, sum_of, tile, rows);
        first_layer_backward(perceptron, sum_of, tile, tile.input, rows);
        if (!pass.rows_gradient) continue;
        const int columns = padded(depth, WIDTH_UNIT);
        multiply_tile<First>(tile.first_gradient, rows, width, perceptron.first_transposed, columns, perceptron.no_bias, 0,
                             tile.sums);
        for (int row = 0; row < rows; ++row) copy(tile.sums + row * columns, depth, pass.rows_gradient + (first + row) * depth);
    }
}

// The receiver of each edge in order.
struct Receiver {
    const int64_t* starts;
    int32_t node;
    void move_to(int64_t edge) {
        while (starts[node + 1] <= edge) ++node;
    }
};

template <typename Number>
void edges_forward(const EdgePass& pass, int32_t begin, int32_t end, float* scratch) {
    using Value = typename Number::Value;
    const Perceptron& perceptron = pass.perceptron;
    const int width = perceptron.width;
    const auto *endpoints = as<const Value>(pass.endpoints), *edges = as<const Value>(pass.edges);
    auto* new_edges = as<Value>(pass.new_edges);
    Tile<Number, Number> tile(perceptron, scratch);
    for (int64_t k = static_cast<int64_t>(begin) * width; k < static_cast<int64_t>(end) * width; k += LANES)
        store(pass.received + k, Floats{});
    Receiver adding{pass.starts, begin}, receiving{pass.starts, begin};
    const int64_t last = pass.starts[end];
    for (int64_t first = pass.starts[begin]; first < last; first += ROW_TILE) {
        const int rows = rows_of_tile(first, last);
        prefetch(edges, first + ROW_TILE, width);
        prefetch(new_edges, first + ROW_TILE, width);
        for (int row = 0; row < rows; ++row) {
            adding.move_to(first + row);
            const Value* sender = endpoints + 2 * width * pass.senders[first + row];
            const Value* receiver = endpoints + width * (2 * static_cast<int64_t>(adding.node) + 1);
            for (int k = 0; k < width; k += LANES)
                store(tile.sums + row * width + k, Number::load(sender + k) + Number::load(receiver + k));
        }
        copy(edges + first * width, static_cast<int64_t>(rows) * width, tile.input);
        multiply_tile<Number>(tile.input, rows, width, perceptron.first, width, tile.sums, width, tile.sums);
        finish_forward(perceptron, tile, rows);
        keep(pass.kept, tile, first, rows, width);
        for (int row = 0; row < rows; ++row) {
            receiving.move_to(first + row);
            float* received = pass.received + static_cast<int64_t>(receiving.node) * width;
            for (int k = 0; k < width; k += LANES) {
                const int at = row * width + k;
                const Floats message = load(tile.sums + at) * load(perceptron.scale + k) + load(perceptron.shift + k);
                store(received + k, load(received + k) + message);
                if (new_edges) Number::store(new_edges + first * width + at, Number::load(tile.input + at) + message);
            }
        }
    }
}

template <typename Number>
void edges_backward(const EdgePass& pass, const PerceptronGradient& sum_of, int32_t begin, int32_t end, float* scratch) {
    using Value = typename Number::Value;
    const Perceptron& perceptron = pass.perceptron;
    const int width = perceptron.width;
    const auto* new_edges_gradient = as<const Value>(pass.new_edges_gradient);
    Tile<Number, Number> tile(perceptron, scratch);
    Receiver receiving{pass.starts, begin};
    const int64_t last = pass.starts[end];
    for (int64_t first = pass.starts[begin]; first < last; first += ROW_TILE) {
        const int rows = rows_of_tile(first, last);
        const int64_t origin = first * width, count = static_cast<int64_t>(rows) * width;
        for (const Value* matrix :
             {as<const Value>(pass.edges), as<const Value>(pass.kept.hidden_1), as<const Value>(pass.kept.hidden_2),
              as<const Value>(pass.kept.normalized), new_edges_gradient, as<const Value>(pass.edges_gradient),
              as<const Value>(pass.first_gradient)})
            prefetch(matrix, first + ROW_TILE, width);
        recall(pass.kept, tile, first, width);
        for (int row = 0; row < rows; ++row) {
            receiving.move_to(first + row);
            const float* received = pass.received_gradient + static_cast<int64_t>(receiving.node) * width;
            for (int k = 0; k < width; k += LANES) {
                const int at = row * width + k;
                const Floats gradient = load(received + k);
                store(tile.sums + at,
                      new_edges_gradient ? gradient + Number::load(new_edges_gradient + origin + at) : gradient);
            }
        }
        finish_backward(perceptron, sum_of, tile, rows);
        first_layer_backward(perceptron, sum_of, tile, as<const Value>(pass.edges) + origin, rows);
        copy(tile.first_gradient, count, as<Value>(pass.first_gradient) + origin);
        multiply_tile<Number>(tile.first_gradient, rows, width, perceptron.first_transposed, width, perceptron.no_bias, 0,
                              tile.sums);
        Value* edges_gradient = as<Value>(pass.edges_gradient) + origin;
        for (int64_t k = 0; k < count; k += LANES) {
            const Floats gradient = load(tile.sums + k);
            Number::store(edges_gradient + k,
                          new_edges_gradient ? gradient + Number::load(new_edges_gradient + origin + k) : gradient);
        }
    }
}

template <typename Number>
void endpoints_backward(const EdgePass& pass, int32_t begin, int32_t end) {
    using Value = typename Number::Value;
    const int width = pass.perceptron.width;
    const auto* gradient = as<const Value>(pass.first_gradient);
    for (int32_t node = begin; node < end; ++node) {
        Value* to = as<Value>(pass.endpoints_gradient) + 2 * static_cast<int64_t>(node) * width;
        for (int k = 0; k < width; k += LANES) {
            Floats as_sender = {}, as_receiver = {};
            for (int64_t e = pass.starts[node]; e < pass.starts[node + 1]; ++e) {
                as_sender += Number::load(gradient + static_cast<int64_t>(pass.by_sender[e]) * width + k);
                as_receiver += Number::load(gradient + e * width + k);
            }
            Number::store(to + k, as_sender);
            Number::store(to + width + k, as_receiver);
        }
    }
}

template <typename Number>
constexpr MessagePassingKernels message_passing_kernels() {
    return {rows_forward<Number, Number>,   rows_backward<Number, Number>, rows_forward<Float32, Number>,
            rows_backward<Float32, Number>, edges_forward<Number>,         edges_backward<Number>,
            endpoints_backward<Number>};
}

}  // namespace
}  // namespace ISA
