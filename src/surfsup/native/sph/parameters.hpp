// Parameters of the DFSPH solver. Python sets them, see sph/native_solver.py; lengths in meters, times in seconds, densities in
// units of the rest density.
#pragma once

#include <vector>

namespace surfsup {

// How solids and walls enter the density of a particle, see sph/boundary.
struct BoundaryParameters {
    float distance_offset;                // added to the distance of a solid
    float min_distance;                   // a solid is never closer than this
    float strength;                       // density of a solid that fills the kernel support, at kernel value 1
    float wall_cell;                      // target side of the cells in which the container's walls are interpolated
    float min_wall_distance;              // a wall is never closer than this
    float fraction_start, fraction_step;  // signed distance of the first entry of the table, and from entry to entry
    std::vector<float> plane_fraction;    // volume fraction of a plane solid by signed distance
};

// Collision handling, see sph/collision.py.
struct CollisionParameters {
    float clearance;        // smallest distance from a solid or wall to a particle's center
    float tolerance;        // by which a particle may fall short of the clearance to a solid
    float lipschitz_bound;  // of signed distances: a neural one may exceed the true distance by this factor
    int rounds;             // projections at most
};

struct SolverParameters {
    float kernel_support;
    float frame_time;
    int substeps;                 // in a frame
    float self_density;           // density of a lone particle
    float divergence_relaxation;  // fraction of the density rate that a substep removes
    float density_relaxation;     // fraction of the predicted density error that a substep removes
    float divergence_deadband;    // 1/s: density rates below this do not enter the predicted density error
    float min_squared_gradient;   // 1/m²: below this the pressure is zero
    float max_density_error;      // larger errors are cut to this
    float viscosity;              // m²/s, times the factor 2 (d + 2) of the Laplacian
    float viscosity_softening;    // fraction of the squared kernel support
    float max_energy_gain;        // J/kg in a frame
    BoundaryParameters boundary;
    CollisionParameters collision;

    float substep_time() const { return frame_time / static_cast<float>(substeps); }
    // Factor from the gradient sums of the kernel to the density gradient, 1/m.
    float gradient_scale() const { return 2.0f * self_density / kernel_support; }
};

}  // namespace surfsup
