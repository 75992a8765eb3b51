// What makes a liquid other than the solver's water: viscosity solved implicitly, friction at solids, surface tension and
// adhesion. See sph/liquid.py for the formulas.
#pragma once

#include <cstdint>

namespace surfsup {

struct LiquidParameters {
    float mass;               // of a particle, in units of one of the scene's density; 1 but in a mixture
    bool implicit_viscosity;  // instead of the explicit one of the solver's parameters
    float viscosity;          // m²/s, times the factor 2 (d + 2) of the Laplacian
    float friction;           // at solids, likewise
    float cohesion;           // m/s²: of a pair at cohesion kernel value 1
    float curvature;          // m/s²: per difference of two surface normals
    float adhesion;           // m/s²: of a solid that fills the kernel support, at adhesion kernel value 1
    float tolerance;          // m/s: root mean square of the residual at which the viscosity counts as solved
    int max_iterations;       // of conjugate gradients in a substep

    bool attracts() const { return cohesion != 0.0f; }
};

// Floats of a particle in a row that two vector loads read: position, density, direction of search or surface normal,
// and in a mixture the number of the liquid, then the dynamic viscosity.
constexpr int LIQUID_ROW = 8;
constexpr int FRICTION_ROW = 9;  // the block of friction, as a symmetric matrix, and what moving solids add, m/s²
constexpr int SYMMETRIC = 6;     // xx, yy, zz, xy, xz, yz

// Working data of the particles in sorted order.
struct LiquidFrame {
    const LiquidParameters* parameters;
    const int32_t* liquid_of;  // of each particle: the number of its parameters; nullptr where there are but one
    float* rows;               // (count + 1, LIQUID_ROW), the last for the padding particle
    float* friction;           // (count, FRICTION_ROW), 1/s and m/s²
    float* inverse_diagonal;   // (count, SYMMETRIC): of the block of the matrix on its diagonal
    float* start;              // (count, 3) velocities before viscosity, with what gravity has added, m/s
    float* change;             // (count, 3) that viscosity made in the substep before, m/s
    float* solution;           // (count, 3) velocities after viscosity, m/s
    float* residual;           // (count, 3), m/s
    float* product;            // (count, 3): the matrix times the direction of search, m/s
};

}  // namespace surfsup
