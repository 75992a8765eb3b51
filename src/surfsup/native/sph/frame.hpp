// What one step of the network works on: plain pointers, so that every isa can be compiled by itself.
#pragma once

#include <array>
#include <cstdint>

#include "sdf/field.hpp"
#include "sph/boundary_map.hpp"
#include "sdf/tree.hpp"

namespace surfsup {

constexpr int KERNELS = 4;
constexpr int ACTIONS = 14, SURROUNDINGS = 6;  // what acts on a particle, and how its neighbors lie, see features.py
constexpr int RISE = 13;                            // the column of density's rise among the first
constexpr int OUTPUTS = 1, OUTPUT_ROOM = 16;

// Numbers of the model that are defined in Python; lengths in meters, times in seconds.
struct Constants {
    float radius;                // reach of a kernel
    float frame_time;            // of a step
    float displacement_scale, velocity_scale, slope_scale, density_scale;
    float own_density;           // a particle's share of its own density, in units of the lattice's
    int steps;                   // of the sweeps, in a frame
    float of_rise, of_excess;    // shares of a sweep that are made
    float slow;                  // 1/s: a rise of density that is not reckoned with in advance
    float least;                 // 1/m²: where density depends on places no more than this, nothing can be done
    float most_dense;            // how much too dense it is taken to be at most
    float viscosity, softened;   // m²/s, with what its Laplacian is multiplied by; a share of the squared radius
    float pressure_scale;        // m²/s of a unit of what the network says, of a unit of density's rise
    float position_share;        // of a velocity correction that shows in the displacement
    float largest;               // largest velocity correction, in displacement_scale
    std::array<float, SURROUNDINGS> thickest;  // largest sums that the factors are told of

    float step_time() const { return frame_time / static_cast<float>(steps); }
    float density_slope() const { return 2.0f * own_density / radius; }  // from the kernels' slope to density's, a meter
};

// What a solid adds to density, see solid_density.py and walls.py: the `share` that a flat one has of the neighborhood by
// its distance, from `deepest` meters on in steps of `step`, `entries` of them; beyond it has none.
struct SolidDensity {
    float deepest, step, support, nearest, offset, strength;
    float wall_cell, closest;    // meters
    int entries;
    const float* share;
};

// Weights as the products take them: a row an input, a column an output; `width` and `messages` are multiples of 16,
// what is beyond the network's own is zero. Neighbors are told of the first `messages` channels.
struct Weights {
    int width, messages, layers, inner;             // `inner` channels between how neighbors lie and the factors
    const float* encoder;                           // (ACTIONS, width)
    const float *factor_in, *factor_in_bias;        // (SURROUNDINGS, inner), (inner)
    const float *factor_out, *factor_out_bias;      // (inner, 2 width), (2 width)
    const float *mix, *out;                         // of each layer (4 messages + width, width), (width, width)
    const float *decode_in, *decode_out;            // (width, width), (width, OUTPUT_ROOM)
};

// The neighbors of a particle within the radius in the frame's middle, filled up to whole vectors by one that is far
// away, with room for what the displacements in the step that is made are multiplied by to give the kernel's slopes.
struct Edges {
    const int32_t* senders;
    float* along;
    int32_t count, filled;
};

constexpr int MOTION = 8;  // floats: a place, a nought, a speed, a nought
constexpr int PUSH = 4;    // floats: a place and a pressure

// What sweeps.py knows of a particle; lengths in meters, times in seconds, densities in the lattice's.
struct Sweep {
    float slope[3];               // of density
    float allowed;                // density
    float drag[3];                // m/s² by viscosity
    float faster[3], farther[3];  // than ballistic motion, so far
    float solid_beyond;           // the solid is farther off than that
};

// Particles sorted by cell. Cells are counted modulo the grid's size, so that any extent fits: what falls into the
// same cell from far away is told apart by its distance. Cells are numbered tile by tile, so that what a particle's
// neighbors are told of is still in the cache when its turn comes.
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
    // as the caller counts:
    const float *positions, *velocities, *ahead, *distance, *normal;
    float gravity[3], lower[3], upper[3];
    float cell[3];               // the sides of those that the solver looks the walls up in
    MapView map;                 // of the solid
    float *new_positions, *new_velocities;
    // sorted:
    Edges* edges;
    float *acts, *lie;           // (count, ACTIONS), (count, SURROUNDINGS); room for a block more
    Sweep* sweeps;
    // of them and one more, which is far away:
    float* motion;               // (count + 1, MOTION): m in this step, and m/s but for what gravity adds
    float* pushes;               // (count + 1, PUSH): m in this step, and the pressure of the sweep that is made
    float* factors;              // (count, width), of the last hidden state
    float* hidden[2];            // (count, width); a layer reads one and writes the other
    float* told[2];              // (count, messages), the part of it that neighbors are told, side by side
};

// Memory that grows as it is asked for and is used again in the next step; each thread has its own.
class Arena;
void* take(Arena& arena, int64_t bytes);  // nullptr where there is none

// One instruction set's way through a step.
struct Isa {
    const char* name;
    bool (*supported)();
    int rows;                    // particles in a block
    int64_t (*scratch)(const Frame&);  // floats that `encode` and `layer` need
    // Neighbors of sorted particles, kept in the first arena; how many edges, -1 where memory ran out. The second one and
    // `search` are what a thread looks with, from one call to the next in the same frame.
    int64_t (*look)(const Frame&, int32_t begin, int32_t end, Arena&, Arena& searching, void* search);
    // A step of the sweeps: density and pressures; then what these do to speeds, and the places of the next step. The last
    // step leaves what the network is told.
    void (*approach)(const Frame&, int step, int32_t begin, int32_t end);
    void (*leave)(const Frame&, int step, int32_t begin, int32_t end);
    // The encoder.
    void (*encode)(const Frame&, int32_t begin, int32_t end, float* scratch);
    // A layer; behind the last one the decoder, which leaves pressures.
    void (*layer)(const Frame&, int number, int32_t begin, int32_t end, float* scratch);
    // What these do, and with it the new positions and velocities.
    void (*finish)(const Frame&, int32_t begin, int32_t end);
    // Of a convolution, for particles begin to end: the sums over neighbors of the first channels of `values`, and
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
    int64_t search_bytes;  // of `search`, zero at first in every frame
    // Signed distance of points begin to end, and their unit normal, unless that is null.
    void (*distance)(const Tree&, const float* points, int32_t begin, int32_t end, float* distance, float* normal);
    // What a network tells of points (count, 3) in its own frame, for which it needs a list of as many and so many floats.
    void (*ask_field)(const Field&, const float* points, int32_t count, const LeafLook&, int32_t* list, float* scratch);
    int64_t (*field_scratch)(const Field&);
};

extern const Isa avx512, avx2, plain;

}  // namespace surfsup
