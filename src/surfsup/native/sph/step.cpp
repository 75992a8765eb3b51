#include "sph/step.hpp"

#include <algorithm>
#include <limits>
#include <vector>

namespace surfsup {
namespace {

// Positions after ballistic motion: n semi-implicit Euler steps of Δt fall by n (n + 1) / 2 Δt² g.
void predict_positions(const Fluid& fluid, const SolverParameters& parameters, float* predicted) {
    const float substeps = static_cast<float>(parameters.substeps);
    const float fall = substeps * (substeps + 1) / 2 * parameters.substep_time() * parameters.substep_time();
    for (int64_t at = 0; at < 3 * static_cast<int64_t>(fluid.count); at += 3)
        for (int axis = 0; axis < 3; ++axis)
            predicted[at + axis] =
                fluid.positions[at + axis] + parameters.frame_time * fluid.velocities[at + axis] + fall * fluid.gravity[axis];
}

}  // namespace

StepResult step(Solver& solver, Fluid fluid, const SolidQuery& solid, bool handle_collisions, const LastQuery& last_query,
                const NewState& state, const SubstepRecord& record, const Isa& isa, int threads, int64_t max_pairs) {
    const SolverParameters& parameters = solver.parameters();
    const auto count = static_cast<size_t>(fluid.count);
    std::vector<float> predicted(3 * count), normal, distance(count, std::numeric_limits<float>::infinity());
    predict_positions(fluid, parameters, predicted.data());
    if (solid && fluid.boundary_map.cell_indices) {
        // The pressure solve reads the map and needs no normal. Collision handling needs exact distances, but only of
        // particles that come near.
        update_query(predicted.data(), fluid.count, parameters.collision, solid, last_query, distance.data());
    } else if (solid) {
        normal.resize(3 * count);
        std::copy(predicted.begin(), predicted.end(), last_query.positions);
        solid(last_query.positions, fluid.count, distance.data(), normal.data());
        std::copy(distance.begin(), distance.end(), last_query.distance);
    }
    fluid.predicted_positions = predicted.data(), fluid.solid_distance = distance.data(),
    fluid.solid_normal = normal.empty() ? nullptr : normal.data();
    std::fill_n(state.collided, count, false);
    const int64_t pairs = solver.advance(fluid, state.positions, state.velocities, record, isa, threads, max_pairs);
    if (pairs < 0 || pairs > max_pairs) return {pairs, 0, false};
    const double work = solver.outer_work();
    const double gain = energy_gain(fluid.positions, fluid.velocities, state.positions, state.velocities, fluid.count,
                                    fluid.gravity, fluid.masses);
    if (gain - work > parameters.max_energy_gain) return {pairs, work, false};
    if (handle_collisions && fluid.moving)
        resolve_moving_collisions(fluid.positions, state.positions, state.velocities, state.collided, fluid.count,
                                  {fluid.lower, fluid.upper}, parameters.collision, solid, &last_query, *fluid.moving,
                                  parameters.frame_time, fluid.impulses);
    else if (handle_collisions)
        resolve_collisions(fluid.positions, state.positions, state.velocities, state.collided, fluid.count,
                           {fluid.lower, fluid.upper}, parameters.collision, solid, &last_query, fluid.impulses);
    return {pairs, work, true};
}

}  // namespace surfsup
