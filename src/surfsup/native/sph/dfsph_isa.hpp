// The substeps of sph/dfsph.py, compiled once for every instruction set.
#pragma once

#include "sph/boundary_isa.hpp"
#include "sph/frame.hpp"
#include "sph/kernels_isa.hpp"

namespace ISA {
namespace {

using namespace surfsup;

inline float positive_part(float value) { return value < 0.0f ? 0.0f : value; }

// The part of a density rate beyond the deadband.
inline float beyond_deadband(float rate, float deadband) {
    return rate - (rate > deadband ? deadband : rate < -deadband ? -deadband : rate);
}

inline float dot(const float* a, const float* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

inline ParticleWork initial_work(const Frame& frame, int64_t caller) {
    const float *from = frame.positions + 3 * caller, *to = frame.predicted_positions + 3 * caller;
    const float path[3] = {to[0] - from[0], to[1] - from[1], to[2] - from[2]};
    ParticleWork work{};
    work.min_solid_distance = frame.solid_distance[caller] - __builtin_sqrtf(dot(path, path)) - MAP_ERROR;
    work.rest_density = 1.0f;
    return work;
}

// Sums over the neighbors of a particle, in units of the kernel's value and gradient.
struct NeighborSums {
    float kernel, gradient[3], squared_gradient, approach, viscous[3], velocity_difference[3];
};

// With RECORD also the sums for a correcting network. In a MIXTURE squared gradients are divided by the neighbors' masses.
template <bool RECORD, bool MIXTURE>
inline NeighborSums sum_neighbors(const Frame& frame, int32_t i) {
    const SolverParameters& p = *frame.parameters;
    const Neighbors& neighbors = frame.neighbors[i];
    const float shrink = 1.0f / p.kernel_support;
    const float *position = frame.motion + MOTION_ROW * static_cast<int64_t>(i), *velocity = position + 4;
    Floats value{}, gradient_x{}, gradient_y{}, gradient_z{}, squares{}, approach{}, viscous_x{}, viscous_y{}, viscous_z{};
    Floats difference_x{}, difference_y{}, difference_z{};
    for (int32_t k = 0; k < neighbors.padded_count; k += LANES) {
        Floats x, y, z, vx, vy, vz, inverse_mass, unused;
        pick_four<MOTION_ROW>(frame.motion, neighbors.indices + k, x, y, z, inverse_mass);
        pick_four<MOTION_ROW>(frame.motion + 4, neighbors.indices + k, vx, vy, vz, unused);
        x = (x - position[0]) * shrink, y = (y - position[1]) * shrink, z = (z - position[2]) * shrink;
        vx -= velocity[0], vy -= velocity[1], vz -= velocity[2];
        const Kernels kernels = kernels_at(x, y, z);
        store(neighbors.gradient_factors + k, kernels.gradient_factor);
        value += kernels.value;
        gradient_x += kernels.gradient_factor * x, gradient_y += kernels.gradient_factor * y,
            gradient_z += kernels.gradient_factor * z;
        squares += MIXTURE ? kernels.steepness * kernels.steepness * inverse_mass : kernels.steepness * kernels.steepness;
        const Floats rate = kernels.gradient_factor * (x * vx + y * vy + z * vz);
        const Floats friction = rate * reciprocal(kernels.squared_distance + p.viscosity_softening);
        approach += rate;
        viscous_x += friction * x, viscous_y += friction * y, viscous_z += friction * z;
        if constexpr (RECORD)
            difference_x += kernels.value * vx, difference_y += kernels.value * vy, difference_z += kernels.value * vz;
    }
    float totals[8];
    sum_each({as_eight(value), as_eight(gradient_x), as_eight(gradient_y), as_eight(gradient_z), as_eight(squares),
              as_eight(approach), as_eight(viscous_x), as_eight(viscous_y)},
             totals);
    NeighborSums sums{totals[0], {totals[1], totals[2], totals[3]},      totals[4],
                      totals[5], {totals[6], totals[7], sum(viscous_z)}, {}};
    if constexpr (RECORD)
        sums.velocity_difference[0] = sum(difference_x), sums.velocity_difference[1] = sum(difference_y),
        sums.velocity_difference[2] = sum(difference_z);
    return sums;
}

inline void record_substep(const SubstepRecord& record, int64_t caller, const float* position, const float* density_gradient,
                           const NeighborSums& sums, float boundary, const float* boundary_gradient, float density_error,
                           float density_rate) {
    std::memcpy(record.positions + 3 * caller, position, 3 * sizeof(float));
    std::memcpy(record.density_gradient + 3 * caller, density_gradient, 3 * sizeof(float));
    float* row = record.kernel_sums + KERNEL_SUMS * caller;
    row[0] = sums.kernel;
    for (int axis = 0; axis < 3; ++axis) {
        row[1 + axis] = sums.gradient[axis];
        row[4 + axis] = sums.velocity_difference[axis];
        record.boundary_gradient[3 * caller + axis] = boundary_gradient[axis];
    }
    row[7] = sums.squared_gradient;
    record.boundary_density[caller] = boundary;
    record.density_error[caller] = density_error;
    record.density_rate[caller] = density_rate;
}

// Densities at the positions of a substep, and the pressures against the density rate and the predicted density error. In a
// MIXTURE a pressure is that per mass times the mass, which is continuous across the boundary of two liquids.
template <bool RECORD, bool MOVING, bool MIXTURE>
inline void compute_pressures_of(const Frame& frame, int substep, int32_t begin, int32_t end) {
    const SolverParameters& p = *frame.parameters;
    const float scale = p.gradient_scale(), time = p.substep_time(), elapsed = static_cast<float>(substep) * time;
    for (int32_t i = begin; i < end; ++i) {
        ParticleWork& work = frame.work[i];
        const int64_t caller = frame.order[i];
        if (substep == 0 && !frame.liquid) work = initial_work(frame, caller);
        const float *position = frame.motion + MOTION_ROW * static_cast<int64_t>(i), *velocity = position + 4;
        const NeighborSums sums = sum_neighbors<RECORD, MIXTURE>(frame, i);
        float boundary_gradient[3], solid_rate = 0.0f;
        const float boundary =
            boundary_density<MOVING>(frame, caller, position, work.min_solid_distance, boundary_gradient, solid_rate);
        const float density = p.self_density * (1.0f + sums.kernel) + boundary;
        float density_rate = -scale * sums.approach;
        for (int axis = 0; axis < 3; ++axis) {
            work.density_gradient[axis] = scale * sums.gradient[axis] + boundary_gradient[axis];
            work.viscous_acceleration[axis] = p.viscosity * scale / p.kernel_support * sums.viscous[axis] / density;
            density_rate += boundary_gradient[axis] * (velocity[axis] + elapsed * frame.gravity[axis]);
        }
        if constexpr (MOVING) {
            density_rate -= solid_rate;
            frame.moving->solid_rate[i] = solid_rate;
        }
        const float mass = MIXTURE ? frame.masses[i] : 1.0f;
        const float of_neighbors = MIXTURE ? mass * sums.squared_gradient : sums.squared_gradient;
        const float squared_gradient = dot(work.density_gradient, work.density_gradient) + scale * scale * of_neighbors;
        const float dfsph_factor = squared_gradient > p.min_squared_gradient ? 1.0f / squared_gradient
                                   : squared_gradient != squared_gradient    ? squared_gradient
                                                                             : 0.0f;
        if (substep == 0 && !frame.boundary_map.cell_indices && frame.solid_distance[caller] < p.kernel_support &&
            density > 1.0f)
            work.rest_density = density;
        const float compression = density - work.rest_density,
                    density_error = compression > p.max_density_error ? p.max_density_error : compression;
        const float divergence_source = p.divergence_relaxation * positive_part(density_rate);
        const float gravity_rate = time * dot(boundary_gradient, frame.gravity);
        const float density_source =
            density_error / time + beyond_deadband(density_rate - divergence_source, p.divergence_deadband) + gravity_rate;
        float* pressure = frame.pressure + PRESSURE_ROW * static_cast<int64_t>(i);
        std::memcpy(pressure, position, 3 * sizeof(float));
        pressure[3] = dfsph_factor * (divergence_source + p.density_relaxation * positive_part(density_source));
        if constexpr (MIXTURE) pressure[3] *= mass;
        if constexpr (RECORD)
            record_substep(frame.record, caller, position, work.density_gradient, sums, boundary, boundary_gradient,
                           density_error, density_rate);
    }
}

void compute_pressures(const Frame& frame, int substep, int32_t begin, int32_t end) {
    const bool record = frame.record.kernel_sums && substep == frame.parameters->substeps - 1;
    if (frame.masses && frame.moving)
        compute_pressures_of<false, true, true>(frame, substep, begin, end);
    else if (frame.masses)
        compute_pressures_of<false, false, true>(frame, substep, begin, end);
    else if (frame.moving)
        compute_pressures_of<false, true, false>(frame, substep, begin, end);
    else if (record)
        compute_pressures_of<true, false, false>(frame, substep, begin, end);
    else
        compute_pressures_of<false, false, false>(frame, substep, begin, end);
}

// The velocity that its own pressure and its neighbors' remove from a particle.
inline void pressure_velocity(const Frame& frame, int32_t i, float* velocity) {
    const Neighbors& neighbors = frame.neighbors[i];
    const float* own = frame.pressure + PRESSURE_ROW * static_cast<int64_t>(i);
    Floats sum_x{}, sum_y{}, sum_z{};
    for (int32_t k = 0; k < neighbors.padded_count; k += LANES) {
        Floats x, y, z, pressure;
        pick_four<PRESSURE_ROW>(frame.pressure, neighbors.indices + k, x, y, z, pressure);
        pressure *= load(neighbors.gradient_factors + k);
        sum_x += pressure * (x - own[0]), sum_y += pressure * (y - own[1]), sum_z += pressure * (z - own[2]);
    }
    const float scale = frame.parameters->gradient_scale() / frame.parameters->kernel_support,
                sums[3] = {sum(sum_x), sum(sum_y), sum(sum_z)};
    for (int axis = 0; axis < 3; ++axis) velocity[axis] = own[3] * frame.work[i].density_gradient[axis] + scale * sums[axis];
}

// Changes velocities by pressures and viscosity and advances the particles. The last substep writes positions and velocities of
// the frame's end instead.
void apply_pressures(const Frame& frame, int substep, int32_t begin, int32_t end) {
    const SolverParameters& p = *frame.parameters;
    const float time = p.substep_time(), elapsed = static_cast<float>(substep + 1) * time;
    const bool last = substep == p.substeps - 1;
    for (int32_t i = begin; i < end; ++i) {
        ParticleWork& work = frame.work[i];
        const int64_t caller = frame.order[i];
        float removed[3];
        pressure_velocity(frame, i, removed);
        float *position = frame.motion + MOTION_ROW * static_cast<int64_t>(i), *velocity = position + 4, square = 0.0f;
        if (frame.masses)
            for (float& component : removed) component *= position[3];
        for (int axis = 0; axis < 3; ++axis) {
            const float change = time * work.viscous_acceleration[axis] - removed[axis];
            work.delta_velocity[axis] += change;
            work.delta_position[axis] += time * work.delta_velocity[axis];
            if (last) {
                const int64_t at = 3 * caller + axis;
                frame.new_positions[at] = frame.predicted_positions[at] + work.delta_position[axis];
                frame.new_velocities[at] =
                    frame.velocities[at] + p.frame_time * frame.gravity[axis] + work.delta_velocity[axis];
                continue;
            }
            velocity[axis] += change;
            const float displacement = time * (velocity[axis] + elapsed * frame.gravity[axis]);
            position[axis] += displacement;
            square += displacement * displacement;
        }
        work.min_solid_distance -= __builtin_sqrtf(square);
    }
}

}  // namespace
}  // namespace ISA
