// What one step of the network works on: plain pointers, so that every path can be compiled by itself.
#pragma once

#include <array>
#include <cstdint>

#include "tree.hpp"

namespace surfsup {

constexpr int KERNELS = 8;
constexpr int WIDE_KERNELS[4] = {0, 2, 3, 4};   // of the wide window, which all neighbours feel
constexpr int CLOSE_KERNELS[4] = {1, 5, 6, 7};  // of the close one
constexpr int ACTIONS = 45;                                       // what acts on a particle, see features.py
constexpr int LIMITED = 24, LIMITED_ROOM = 32;  // of them through a soft limit; they come first in a row
constexpr int ROW = 53;                         // room for a row of what acts
constexpr int OUTPUTS = 6, OUTPUT_ROOM = 16;

// Numbers of the model that are defined in Python; lengths in metres, times in seconds.
struct Constants {
    float radius, close;         // reach of a kernel; share of it that the close window reaches
    float frame_time;            // of a step
    float reach;                 // beyond which a solid is not felt
    float displacement_scale, velocity_scale;
    float crowded;               // sum of the close window above which neighbours are too near
    float position_share;        // of a velocity correction that shows in the displacement
    float largest;           // largest velocity correction, in displacement_scale
    std::array<float, KERNELS> thickest;  // largest kernel sums that the factors are told of
};

// Weights as the products take them: a row an input, a column an output; `width` and `messages` are multiples of 16,
// what is beyond the network's own is zero. Neighbours are told of the first `messages` channels.
struct Weights {
    int width, messages, layers;
    const float *encode_in, *encode_out;            // (ROW, width), (width, width)
    const float *factor_in, *factor_in_bias;        // (8, width), (width)
    const float *factor_out, *factor_out_bias;      // (width, 2 width), (2 width)
    const float *mix, *out;                         // of each layer (8 messages + width, width), (width, width)
    const float *decode_in, *decode_out;            // (width, width), (width, OUTPUT_ROOM)
};

// The neighbours of a particle, near ones first. Kernels lie kernel by kernel: four of all, then four of the near ones.
struct Edges {
    const float* kernels;
    const int32_t* senders;
    int32_t near, all;
};

// Particles sorted by cell. Cells are counted modulo the grid's size, so that any extent fits: what falls into the
// same cell from far away is told apart by its distance. Cells are numbered tile by tile, so that what a particle's
// neighbours are told of is still in the cache when its turn comes.
constexpr int TILE = 4;  // cells along each side of one

struct Cells {
    int32_t size[3];  // in tiles
    const int32_t* first;  // (cells + 1)
    const int32_t* of;     // cell of each sorted particle
};

struct Frame {
    int32_t count;
    Constants constants;
    Weights weights;
    Cells cells;
    const int32_t* order;        // sorted -> as the caller counts
    const float *x, *y, *z;      // sorted, where ballistic motion goes; room for 16 more
    const float* velocity;       // sorted, (count, 4), the last a one
    // as the caller counts:
    const float *velocities, *ahead, *distance, *normal;
    float gravity[3], lower[3], upper[3];
    float *new_positions, *new_velocities;
    // sorted:
    Edges* edges;
    float* factors;              // (count, width), of the last hidden state
    float* hidden[2];            // (count, width); a layer reads one and writes the other
    float* told[2];              // (count, messages), the part of it that neighbours are told, side by side
};

// Memory that grows as it is asked for and is used again in the next step; each thread has its own.
class Arena;
void* take(Arena& arena, int64_t bytes);  // nullptr where there is none

// One instruction set's way through a step.
struct Path {
    const char* name;
    bool (*supported)();
    int rows;                    // particles in a block
    int64_t (*scratch)(const Frame&);  // floats that `look` and `layer` need
    // Neighbours, kernels, features and encoder of sorted particles; how many edges, -1 where memory ran out.
    int64_t (*look)(const Frame&, int32_t begin, int32_t end, Arena&, float* scratch);
    // A layer; behind the last one the decoder and the new positions and velocities.
    void (*layer)(const Frame&, int number, int32_t begin, int32_t end, float* scratch);
    // Of a convolution, for particles begin to end: the sums over neighbours of the first channels of `values`, and
    // the own values, mixed by `weights` (8 messages + width, width).
    void (*convolve)(const Sparse&, Channels, const float* values, const float* weights, float* out, int32_t begin,
                     int32_t end, float* scratch);
    // The gradient in the values from that in `out`, by `weights` (9 width, width); each edge is taken the other way.
    void (*convolve_back)(const Sparse&, Channels, const float* gradient, const float* weights, float* to_values,
                          int32_t begin, int32_t end, float* scratch);
    // Adds to `to` (8 messages + width, width) the gradient in the weights.
    void (*weigh)(const Sparse&, Channels, const float* values, const float* gradient, float* to, int32_t begin,
                  int32_t end, float* scratch);
    // The places of sorted particles that are within the radius of the sorted particle i, in any order; how many, -1
    // where memory ran out. `to` points to them until the next call.
    int64_t (*within)(const Frame&, int32_t i, Arena&, void* search, const int32_t*& to);
    int64_t search_bytes;  // of `search`, zero at first
    // Signed distance and unit normal of points begin to end.
    void (*distance)(const Tree&, const float* points, int32_t begin, int32_t end, float* distance, float* normal);
};

extern const Path avx512, avx2, plain;

}  // namespace surfsup
