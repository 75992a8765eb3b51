// A whole frame: ballistic motion, query of the solid, DFSPH substeps, energy limit, collision handling.
#pragma once

#include <cstdint>

#include "sph/collision.hpp"
#include "sph/solver.hpp"

namespace surfsup {

// What a frame writes: (count, 3), (count, 3), (count).
struct NewState {
    float *positions, *velocities;
    bool* collided;
};

struct StepResult {
    int64_t pairs;      // of neighbors, see Solver::advance
    double outer_work;  // of moving solids and walls, surface tension and adhesion on the particles, mean J/kg
    bool finished;      // false where the energy limit was exceeded: limiting and collision handling are left to the caller
};

// `fluid` needs neither predicted positions nor distances and normals of the solid: they are computed here. `last_query` holds
// where each particle last queried the solid and is updated.
StepResult step(Solver& solver, Fluid fluid, const SolidQuery& solid, bool handle_collisions, const LastQuery& last_query,
                const NewState& state, const SubstepRecord& record, const Isa& isa, int threads, int64_t max_pairs);

}  // namespace surfsup
