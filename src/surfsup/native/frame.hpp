// What one step of the network works on: plain pointers, so that every path can be compiled by itself.
#pragma once

#include <array>
#include <cstdint>

#include "tree.hpp"

namespace surfsup {

constexpr int KERNELS = 4;
constexpr int ACTIONS = 37, SURROUNDINGS = 6;  // what acts on a particle, and how its neighbours lie, see features.py
constexpr int SWEEP_STEPS = 2;  // in a frame, see sweeps.py
constexpr int OUTPUTS = 6, OUTPUT_ROOM = 16;

// Numbers of the model that are defined in Python; lengths in metres, times in seconds.
struct Constants {
    float radius;                // reach of a kernel
    float frame_time;            // of a step
    float reach;                 // beyond which a solid is not felt
    float displacement_scale, velocity_scale, nearness_scale, density_scale;
    float own_density;           // a particle's share of its own density, in units of the lattice's
    float densest;               // the largest density told of
    float sweep_time;            // of a step of the sweeps
    float of_rise, of_excess;    // shares of a sweep that are made
    float least;                 // 1/m²: where density depends on places no more than this, nothing can be done
    float position_share;        // of a velocity correction that shows in the displacement
    float largest;               // largest velocity correction, in displacement_scale
    std::array<float, SURROUNDINGS> thickest;  // largest sums that the factors are told of
};

// What a flat solid adds to density by its distance: `density` and minus its slope a support radius, from `deepest` metres
// on in steps of `step`, `entries` of them, up to `support`, beyond which it adds nothing.
struct SolidDensity {
    float deepest, step, support;
    int entries;
    const float *density, *slope;
};

// Weights as the products take them: a row an input, a column an output; `width` and `messages` are multiples of 16,
// what is beyond the network's own is zero. Neighbours are told of the first `messages` channels.
struct Weights {
    int width, messages, layers;
    const float *encode_in, *encode_out;            // (ACTIONS, width), (width, width)
    const float *factor_in, *factor_in_bias;        // (SURROUNDINGS, width), (width)
    const float *factor_out, *factor_out_bias;      // (width, 2 width), (2 width)
    const float *mix, *out;                         // of each layer (4 messages + width, width), (width, width)
    const float *decode_in, *decode_out;            // (width, width), (width, OUTPUT_ROOM)
};

// The neighbours of a particle and their kernels, kernel by kernel.
struct Edges {
    const float* kernels;
    const int32_t* senders;
    int32_t count;
};

// What sweeps.py knows of a particle; lengths in metres, times in seconds, densities in the lattice's.
struct Sweep {
    float slope_of_fluid[3], stiffness, rise;   // density's slope by the neighbours, and how fast it rises by them, at first
    float fluid, density, allowed;              // of the neighbours, with that of solids, and how high it may be
    float slope[3], slope_of_solids[3], ease;   // in this step, with that of solids, and that alone
    float rising;                               // how fast density rises now by the neighbours
    float farther[3];
    bool near_solids;
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
    SolidDensity solids;
    Weights weights;
    Cells cells;
    const int32_t* order;        // sorted -> as the caller counts
    const float *x, *y, *z;      // sorted, where ballistic motion is halfway; room for 16 more
    const float* velocity;       // sorted, (count, 4), the last a one
    // as the caller counts:
    const float *positions, *velocities, *ahead, *distance, *normal;
    float gravity[3], lower[3], upper[3];
    float *new_positions, *new_velocities;
    // sorted:
    Edges* edges;
    float *acts, *lie;           // (count, ACTIONS), (count, SURROUNDINGS); room for a block more
    Sweep* sweeps;
    float* faster;               // (count, 4): m/s that the sweeps add to velocities, and nothing
    float* taken;                // (count), the pressures of the sweep that is made
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
    int64_t (*scratch)(const Frame&);  // floats that `encode` and `layer` need
    // Neighbours, kernels and features of sorted particles; how many edges, -1 where memory ran out.
    int64_t (*look)(const Frame&, int32_t begin, int32_t end, Arena&);
    // The halves of the sweeps of a step: velocities by the pressures, and pressures by the velocities.
    void (*push)(const Frame&, bool last_of_step, int32_t begin, int32_t end);
    void (*press)(const Frame&, int step, bool excess, int32_t begin, int32_t end);
    // The encoder.
    void (*encode)(const Frame&, int32_t begin, int32_t end, float* scratch);
    // A layer; behind the last one the decoder and the new positions and velocities.
    void (*layer)(const Frame&, int number, int32_t begin, int32_t end, float* scratch);
    // Of a convolution, for particles begin to end: the sums over neighbours of the first channels of `values`, and
    // the own values, mixed by `weights` (4 messages + width, width).
    void (*convolve)(const Sparse&, Channels, const float* values, const float* weights, float* out, int32_t begin,
                     int32_t end, float* scratch);
    // The gradient in the values from that in `out`, by `weights` (5 width, width); each edge is taken the other way.
    void (*convolve_back)(const Sparse&, Channels, const float* gradient, const float* weights, float* to_values,
                          int32_t begin, int32_t end, float* scratch);
    // Adds to `to` (4 messages + width, width) the gradient in the weights.
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
