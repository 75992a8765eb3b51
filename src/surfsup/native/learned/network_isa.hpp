// The network, compiled once a isa.
#pragma once

#include "sph/frame.hpp"
#include "sph/kernels_isa.hpp"

namespace ISA {
namespace {

using namespace surfsup;

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

// The product of a block of rows, HEIGHT at a time, with `columns` columns of rows of `w_row` floats; `use` takes each
// vector of it: (row, column, values). Not inlined: among other code its sums would not stay in the registers.
template <int HEIGHT, int VECTORS, typename Use>
__attribute__((noinline)) void product_by(const float* a, int64_t a_row, int depth, const float* w, int64_t w_row, int columns, Use use) {
    for (int first = 0; first < ROWS; first += HEIGHT)
        for (int column = 0; column < columns; column += VECTORS * LANES) {
            Floats sums[HEIGHT][VECTORS];
            multiply(a + first * a_row, a_row, depth, w + column, w_row, sums);
#pragma GCC unroll 12
            for (int row = 0; row < HEIGHT; ++row)
#pragma GCC unroll 3
                for (int v = 0; v < VECTORS; ++v) use(first + row, column + v * LANES, sums[row][v]);
        }
}

template <typename Use>
inline void product(const float* a, int64_t a_row, int depth, const float* w, int64_t w_row, int columns, Use use) {
    if (columns % (2 * LANES) == 0)
        product_by<ROWS, 2>(a, a_row, depth, w, w_row, columns, use);
    else if (columns % (3 * LANES) == 0)
        product_by<ROWS / 2, 3>(a, a_row, depth, w, w_row, columns, use);
    else
        product_by<ROWS, 1>(a, a_row, depth, w, w_row, columns, use);
}

// All columns of the weights.
template <typename Use>
inline void product(const float* a, int64_t a_row, int depth, const float* w, int columns, Use use) {
    product(a, a_row, depth, w, columns, columns, use);
}

constexpr int GATHERED = 2;  // vectors of channels that are summed together: a kernel is spread over a vector once for both

constexpr int32_t TAKEN = 64;  // edges whose kernels are made in one go: their sums and what they take do not fit the registers

// The kernels of a sorted particle's edges from `first` on, up to `end`, each kernel's side by side.
inline void kernels_of(const Frame& frame, int32_t i, int32_t first, int32_t end, float (&kernels)[KERNELS][TAKEN]) {
    const float shrink = 1.0f / frame.constants.radius, *place = frame.motion + MOTION * static_cast<int64_t>(i);
    for (int32_t e = first; e < end; e += LANES) {
        Floats x, y, z, nought;
        pick_four<MOTION>(frame.motion, frame.edges[i].senders + e, x, y, z, nought);
        x = (x - place[0]) * shrink, y = (y - place[1]) * shrink, z = (z - place[2]) * shrink;
        const Kernels here = kernels_at(x, y, z);
        store(kernels[0] + (e - first), here.window);
        store(kernels[1] + (e - first), here.along * x);
        store(kernels[2] + (e - first), here.along * y);
        store(kernels[3] + (e - first), here.along * z);
    }
}

// Sums over the neighbors of sorted particle i of VECTORS vectors of what they tell, for every kernel apart, `row` floats from
// one neighbor, and from one kernel, to the next.
template <int VECTORS>
inline void gather(const Frame& frame, int32_t i, const float* told, int row, float* to) {
    const Edges& edges = frame.edges[i];
    // Some neighbors at a time, each to sums of its own: four sums alone would wait for each other's additions.
    Floats sums[AT_ONCE][KERNELS][VECTORS];
#pragma GCC unroll 2
    for (int s = 0; s < AT_ONCE; ++s)
#pragma GCC unroll 4
        for (int m = 0; m < KERNELS; ++m)
#pragma GCC unroll 2
            for (int v = 0; v < VECTORS; ++v) sums[s][m][v] = Floats{};
    const int32_t count = edges.count;
    for (int32_t first = 0; first < count; first += TAKEN) {
        const int32_t* senders = edges.senders + first;
        const int here = count - first < TAKEN ? count - first : TAKEN;
        float kernels[KERNELS][TAKEN];
        kernels_of(frame, i, first, first + here, kernels);
        const auto add = [&](int edge, Floats(&to_these)[KERNELS][VECTORS]) {
            const float* from = told + static_cast<int64_t>(senders[edge]) * row;
            Floats values[VECTORS];
#pragma GCC unroll 2
            for (int v = 0; v < VECTORS; ++v) values[v] = load(from + v * LANES);
#pragma GCC unroll 4
            for (int m = 0; m < KERNELS; ++m) {
                const Floats weight = splat(kernels[m][edge]);
#pragma GCC unroll 2
                for (int v = 0; v < VECTORS; ++v) to_these[m][v] += weight * values[v];
            }
        };
        int edge = 0;
        for (; edge + AT_ONCE <= here; edge += AT_ONCE)
#pragma GCC unroll 2
            for (int s = 0; s < AT_ONCE; ++s) add(edge + s, sums[s]);
        if (edge < here) add(edge, sums[0]);
    }
#pragma GCC unroll 4
    for (int m = 0; m < KERNELS; ++m)
#pragma GCC unroll 2
        for (int v = 0; v < VECTORS; ++v) {
            Floats sum = sums[0][m][v];
#pragma GCC unroll 2
            for (int s = 1; s < AT_ONCE; ++s) sum += sums[s][m][v];
            store(to + m * row + v * LANES, sum);
        }
}

// How many particles before its turn what a particle needs is fetched: first which its neighbors are, then what
// these say. Its addresses are known too late for the processor to do that by itself.
constexpr int32_t EDGES_AHEAD = 3, HIDDEN_AHEAD = 1;
constexpr int64_t FETCHED = 64;         // bytes
constexpr int64_t CACHED = 1024 * 1024;  // bytes of hidden states up to which they are near anyway

// GCC takes a function that only fetches for one that does nothing, and leaves out its calls; so these are none.
#define ALWAYS_INLINE inline __attribute__((always_inline))

ALWAYS_INLINE void fetch(const void* from, int64_t bytes) {
    for (int64_t at = 0; at < bytes; at += FETCHED) __builtin_prefetch(static_cast<const char*>(from) + at);
}

ALWAYS_INLINE void fetch_ahead(const Frame& frame, int32_t i, const float* told, int messages) {
    if (i + EDGES_AHEAD < frame.count) {
        const Edges& edges = frame.edges[i + EDGES_AHEAD];
        fetch(edges.senders, 4 * static_cast<int64_t>(edges.filled));
    }
    if (i + HIDDEN_AHEAD < frame.count) {
        const Edges& edges = frame.edges[i + HIDDEN_AHEAD];
        for (int32_t e = 0; e < edges.count; ++e)
            fetch(told + static_cast<int64_t>(edges.senders[e]) * messages, 4 * static_cast<int64_t>(messages));
    }
}

// A vector of a particle's hidden state, and of what it tells its neighbors of it.
inline void keep_hidden(const Frame& frame, int which, int64_t i, int column, Floats values) {
    const int width = frame.weights.width, messages = frame.weights.messages;
    store(frame.hidden[which] + i * width + column, values);
    if (column < messages) store(frame.told[which] + i * messages + column, values);
}

void encode(const Frame& frame, int32_t begin, int32_t end, float* scratch) {
    const Weights& w = frame.weights;
    const int width = w.width, inner = w.inner;
    float *one = scratch, *factors = one + ROWS * inner;
    for (int32_t block = begin; block < end; block += ROWS) {
        const int here = end - block < ROWS ? end - block : ROWS;
        const float* acts = frame.acts + static_cast<int64_t>(block) * ACTIONS;
        const float* lie = frame.lie + static_cast<int64_t>(block) * SURROUNDINGS;
        product(lie, SURROUNDINGS, SURROUNDINGS, w.factor_in, inner, [&](int row, int column, Floats sum) {
            store(one + row * inner + column, silu(sum + load(w.factor_in_bias + column)));
        });
        product(one, inner, inner, w.factor_out, 2 * width, [&](int row, int column, Floats sum) {
            store(factors + row * 2 * width + column, 1.0f + (sum + load(w.factor_out_bias + column)));
        });
        product(acts, ACTIONS, ACTIONS, w.encoder, width, [&](int row, int column, Floats sum) {
            if (row >= here) return;
            const int64_t at = static_cast<int64_t>(block + row) * width + column;
            const float* factor = factors + row * 2 * width + column;
            keep_hidden(frame, 0, block + row, column, silu(sum) * load(factor));
            store(frame.factors + at, load(factor + width));
        });
    }
}

void decode(const Frame& frame, int32_t block, int here, const float* hidden, float* scratch) {
    const Weights& w = frame.weights;
    const int width = w.width;
    float *scaled = scratch, *one = scaled + ROWS * width, *out = one + ROWS * width;
    for (int row = 0; row < here; ++row)
        for (int column = 0; column < width; column += LANES)
            store(scaled + row * width + column,
                  load(hidden + row * width + column) *
                      load(frame.factors + static_cast<int64_t>(block + row) * width + column));
    product(scaled, width, width, w.decode_in, width, [&](int row, int column, Floats sum) {
        store(one + row * width + column, silu(sum));
    });
    product(one, width, width, w.decode_out, OUTPUT_ROOM, [&](int row, int column, Floats sum) {
        store(out + row * OUTPUT_ROOM + column, sum);
    });
    for (int row = 0; row < here; ++row) {
        const float share = out[row * OUTPUT_ROOM], rise = frame.acts[static_cast<int64_t>(block + row) * ACTIONS + RISE];
        frame.pushes[PUSH * static_cast<int64_t>(block + row) + 3] = share < 0.0f || rise < 0.0f ? 0.0f : frame.constants.pressure_scale * share * rise;
    }
}

void layer(const Frame& frame, int number, int32_t begin, int32_t end, float* scratch) {
    const Weights& w = frame.weights;
    const int width = w.width, messages = w.messages, depth = KERNELS * messages + width;
    const float* mix = w.mix + static_cast<int64_t>(number) * depth * width;
    const float* out = w.out + static_cast<int64_t>(number) * width * width;
    const float *hidden = frame.hidden[number % 2], *told = frame.told[number % 2];
    const int next = 1 - number % 2;
    const bool last = number == w.layers - 1, fetches = static_cast<int64_t>(frame.count) * width * 4 > CACHED;
    float *sums = scratch, *one = sums + ROWS * depth, *rest = one + ROWS * width;
    for (int32_t block = begin; block < end; block += ROWS) {
        const int here = end - block < ROWS ? end - block : ROWS;
        for (int row = 0; row < here; ++row) {
            float* to = sums + static_cast<int64_t>(row) * depth;
            if (fetches) fetch_ahead(frame, block + row, told, messages);
            int column = 0;
            for (; column + GATHERED * LANES <= messages; column += GATHERED * LANES)
                gather<GATHERED>(frame, block + row, told + column, messages, to + column);
            for (; column < messages; column += LANES) gather<1>(frame, block + row, told + column, messages, to + column);
            std::memcpy(to + KERNELS * messages, hidden + static_cast<int64_t>(block + row) * width, 4 * static_cast<size_t>(width));
        }
        product(sums, depth, depth, mix, width, [&](int row, int column, Floats sum) {
            store(one + row * width + column, silu(sum));
        });
        product(one, width, width, out, width, [&](int row, int column, Floats sum) {
            if (row >= here) return;
            const int64_t at = static_cast<int64_t>(block + row) * width + column;
            keep_hidden(frame, next, block + row, column, load(hidden + at) + sum);
        });
        if (last) decode(frame, block, here, frame.hidden[next] + static_cast<int64_t>(block) * width, rest);
    }
}

int64_t scratch(const Frame& frame) {
    const int64_t width = frame.weights.width;
    const int64_t to_encode = frame.weights.inner + 2 * width, to_layer = KERNELS * frame.weights.messages + (1 + 1 + 2) * width + OUTPUT_ROOM;
    return ROWS * (to_encode > to_layer ? to_encode : to_layer);
}

}  // namespace
}  // namespace ISA
