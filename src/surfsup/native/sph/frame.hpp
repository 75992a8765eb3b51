// Working data of a frame as plain pointers, so that the code of every instruction set can be compiled by itself.
#pragma once

#include <cstdint>

#include "sph/boundary_map.hpp"
#include "sph/liquid.hpp"
#include "sph/parameters.hpp"
#include "sph/rigid_motion.hpp"

namespace surfsup {

// The neighbors of a particle within the kernel support at the middle of the frame. The list is padded to whole vectors with
// a particle far away.
struct Neighbors {
    const int32_t* indices;
    float* gradient_factors;  // factor from the displacement to the kernel gradient, of the present substep
    int32_t count, padded_count;
};

// Floats of a particle in a row that a vector load reads at once.
constexpr int MOTION_ROW = 8;    // position, inverse mass in a mixture, velocity, 0
constexpr int PRESSURE_ROW = 4;  // position, pressure; in a mixture times the mass

// State of a particle within a frame.
struct ParticleWork {
    float density_gradient[3];      // 1/m
    float rest_density;             // the density that counts as no error
    float viscous_acceleration[3];  // m/s²
    float delta_velocity[3];        // m/s, relative to ballistic motion
    float delta_position[3];        // m, relative to ballistic motion
    float min_solid_distance;       // lower bound of the distance to the solid
};

// Cells of a hash grid of sorted particles. Cell coordinates are taken modulo the grid size, so that any extent
// fits; the distance separates particles of distant cells that share an entry. Cells are numbered tile by tile, so
// that the neighbors of one particle are still in the cache when the next needs them.
constexpr int TILE = 4;  // cells along each side of a tile

struct Cells {
    int32_t size[3];         // in tiles
    const int32_t* first;    // (cells + 1) first particle of each cell
    const int32_t* cell_of;  // cell of each sorted particle
};

// Quantities of a substep for a network that corrects the solver, in the caller's order of particles. See sph/dfsph.py:
// Substep.
struct SubstepRecord {
    float* positions;          // (count, 3)
    float* kernel_sums;        // (count, 8): kernel, its gradient (3), neighbors' velocity difference (3), squared gradients
    float* density_gradient;   // (count, 3), 1/m
    float* boundary_density;   // (count)
    float* boundary_gradient;  // (count, 3), 1/m
    float* density_error;      // (count)
    float* density_rate;       // (count), 1/s
};
constexpr int KERNEL_SUMS = 8;

// A moving solid at the start of a substep. Its map is rotated, not translated.
struct MovingBoundary {
    BoundaryMapView boundary_map;
    RigidStep step;
    float lower[3], upper[3];  // a box in its own frame; outside it the solid is beyond the kernel support
};

// What moves during a substep.
struct MovingFrame {
    const RigidStep* walls;  // nullptr for walls that stand still
    const MovingBoundary* solids;
    int32_t solid_count;
    float* solid_rate;  // of each sorted particle, 1/s: density rate that the motion of solids takes away
};

struct Frame {
    int32_t count;
    const SolverParameters* parameters;
    Cells cells;
    const int32_t* order;    // caller's index of each sorted particle
    const float *x, *y, *z;  // sorted positions at the middle of the ballistic path; room for 16 more

    // In the caller's order; vectors are (count, 3). Without a solid, and with a map, there are no normals.
    const float *positions, *velocities, *predicted_positions, *solid_distance, *solid_normal;
    float gravity[3], lower[3], upper[3];
    float wall_cell[3];  // sides of the cells in which the walls are interpolated
    BoundaryMapView boundary_map;
    float *new_positions, *new_velocities;
    const MovingFrame* moving;  // nullptr where nothing moves
    const LiquidFrame* liquid;  // nullptr for the solver's own water
    const float* masses;        // of sorted particles in a mixture; nullptr where all are 1
    SubstepRecord record;       // of the last substep; null pointers for none

    // In sorted order. `motion` and `pressure` have one more row, for the padding particle.
    Neighbors* neighbors;
    ParticleWork* work;
    float* motion;    // (count + 1, MOTION_ROW); the velocity excludes what gravity has added since the frame began
    float* pressure;  // (count + 1, PRESSURE_ROW)
};

}  // namespace surfsup
