// Surface tension, adhesion and implicit viscosity of a substep, compiled once for every instruction set. See sph/liquid.py.
#pragma once

#include "sph/boundary_isa.hpp"
#include "sph/dfsph_isa.hpp"
#include "sph/impulses.hpp"
#include "sph/liquid.hpp"

namespace ISA {
namespace {

using namespace surfsup;

// Of Akinci et al. 2013 at distances in units of the kernel support, without the factor 32 / (π h³).
inline Floats cohesion_at(Floats distance) {
    const Floats open = at_least(1.0f - distance, 0.0f), product = open * distance, cube = product * product * product;
    return distance > 0.5f ? cube : 2.0f * cube - 1.0f / 64.0f;
}

// Of the same authors, without the factor 0.007 / h³.
inline float adhesion_at(float distance) {
    const float inside = -4.0f * distance * distance + 6.0f * distance - 2.0f;
    return distance > 0.5f && inside > 0.0f ? __builtin_sqrtf(__builtin_sqrtf(inside)) : 0.0f;
}

// The steepness -dW/dq of the kernel, in units of its peak.
inline float steepness_at(float distance) {
    const float outer = distance < 1.0f ? 1.0f - distance : 0.0f, inner = distance < 0.5f ? 0.5f - distance : 0.0f;
    return 6.0f * outer * outer - 24.0f * inner * inner;
}

constexpr int32_t WALLS = -2, STILL = -1;

// A solid near a particle: which (the walls, what stands still, or the number of one that moves), distance, volume fraction,
// unit normal, and velocity there.
struct Contact {
    int32_t solid;
    float distance, fraction, normal[3], velocity[3];
};

// Calls `use` with every solid near a sorted particle.
template <typename Use>
inline void for_each_contact(const Frame& frame, int32_t i, const float* position, float& min_solid_distance, const Use& use) {
    Contact walls{WALLS, 0.0f, 0.0f, {}, {}};
    const RigidStep* moving_walls = frame.moving ? frame.moving->walls : nullptr;
    float own[3] = {position[0], position[1], position[2]}, towards[3], square;
    if (moving_walls) moving_walls->place.to_own(position, own);
    if (walls_near(frame, own, walls.distance, walls.fraction, towards, square)) {
        for (float& component : towards) component *= -1.0f / __builtin_sqrtf(square);
        std::memcpy(walls.normal, towards, sizeof towards);
        if (moving_walls) {
            moving_walls->place.rotate(towards, walls.normal);
            moving_walls->velocity(position, walls.velocity);
        }
        use(walls);
    }
    Contact still{STILL, 0.0f, 0.0f, {}, {}};
    if (still_solid_near(frame, frame.order[i], position, min_solid_distance, still.distance, still.fraction, still.normal))
        use(still);
    for (int32_t k = 0; frame.moving && k < frame.moving->solid_count; ++k) {
        Contact moving{k, 0.0f, 0.0f, {}, {}};
        const MovingBoundary& solid = frame.moving->solids[k];
        if (!moving_solid_near(solid, position, moving.distance, moving.fraction, moving.normal)) continue;
        solid.step.velocity(position, moving.velocity);
        use(moving);
    }
}

// Where the reference has the point of a solid: half a particle radius below its surface, and never closer than a spacing.
inline float shifted_distance(const SolverParameters& p, float distance) {
    const float shifted = distance + p.boundary.distance_offset;
    return (shifted < p.boundary.min_distance ? p.boundary.min_distance : shifted) / p.kernel_support;
}

// Friction at a contact times the particle's density, 1/s: along the normal and across. The reference has a quarter of the
// solid's volume at each of four points half a kernel support aside; their sum has no other entries.
inline void friction_at(const SolverParameters& p, const LiquidParameters& liquid, const Contact& contact, float& along,
                        float& across) {
    constexpr float ASIDE = 0.25f;  // squared, in units of the squared kernel support
    const float depth = shifted_distance(p, contact.distance), square = depth * depth + ASIDE, far = __builtin_sqrtf(square);
    const float scale = liquid.friction * p.boundary.strength * contact.fraction * steepness_at(far) /
                        (p.kernel_support * p.kernel_support * far * (square + p.viscosity_softening));
    along = scale * depth * depth, across = scale * 0.5f * ASIDE;
}

// Change of velocity towards a contact by adhesion in a substep, m/s.
inline float adhesion_of(const SolverParameters& p, const LiquidParameters& liquid, const Contact& contact) {
    return p.substep_time() * liquid.adhesion * contact.fraction * adhesion_at(shifted_distance(p, contact.distance));
}

// The parameters of the liquid of a sorted particle.
inline const LiquidParameters& liquid_at(const LiquidFrame& liquid, int32_t i) {
    return liquid.parameters[liquid.liquid_of ? liquid.liquid_of[i] : 0];
}

// Densities of particles begin to end, and what solids do to each: friction is kept, adhesion changes its velocity. Keeps the
// kernels of the neighbors, too.
void measure_liquid(const Frame& frame, int substep, int32_t begin, int32_t end) {
    const SolverParameters& p = *frame.parameters;
    const LiquidFrame& liquid = *frame.liquid;
    for (int32_t i = begin; i < end; ++i) {
        ParticleWork& work = frame.work[i];
        const LiquidParameters& parameters = liquid_at(liquid, i);
        if (substep == 0) work = initial_work(frame, frame.order[i]);
        float *position = frame.motion + MOTION_ROW * static_cast<int64_t>(i), *velocity = position + 4;
        float* row = liquid.rows + LIQUID_ROW * static_cast<int64_t>(i);
        float* friction = liquid.friction + FRICTION_ROW * static_cast<int64_t>(i);
        for (int k = 0; k < FRICTION_ROW; ++k) friction[k] = 0.0f;
        float density = p.self_density * (1.0f + sum_neighbors<false, false>(frame, i).kernel);
        for_each_contact(frame, i, position, work.min_solid_distance, [&](const Contact& contact) {
            const float* n = contact.normal;
            float slope, along, across;
            add_solid(p, contact.distance, contact.fraction, density, slope);
            friction_at(p, parameters, contact, along, across);
            const float more = along - across, speed = more * dot(n, contact.velocity),
                        pull = adhesion_of(p, parameters, contact);
            for (int axis = 0; axis < 3; ++axis) {
                friction[axis] += across + more * n[axis] * n[axis];
                friction[3 + axis] += more * n[axis == 2] * n[axis == 0 ? 1 : 2];
                friction[SYMMETRIC + axis] += across * contact.velocity[axis] + speed * n[axis];
                velocity[axis] -= pull * n[axis];
                work.delta_velocity[axis] -= pull * n[axis];
            }
        });
        for (int k = 0; k < FRICTION_ROW; ++k) friction[k] = parameters.mass * friction[k] / density;
        std::memcpy(row, position, 3 * sizeof(float));
        row[3] = density;
        row[7] = liquid.liquid_of ? static_cast<float>(liquid.liquid_of[i]) : 0.0f;
    }
}

// Surface normals of Akinci et al. 2013, which point into the liquid and are zero within. In a MIXTURE each liquid has its own.
template <bool MIXTURE>
inline void find_surface_normals_of(const Frame& frame, int32_t begin, int32_t end) {
    const LiquidFrame& liquid = *frame.liquid;
    const float scale = 2.0f * frame.parameters->self_density / frame.parameters->kernel_support;
    for (int32_t i = begin; i < end; ++i) {
        const Neighbors& neighbors = frame.neighbors[i];
        float* row = liquid.rows + LIQUID_ROW * static_cast<int64_t>(i);
        Floats sum_x{}, sum_y{}, sum_z{};
        for (int32_t k = 0; k < neighbors.padded_count; k += LANES) {
            Floats x, y, z, density;
            pick_four<LIQUID_ROW>(liquid.rows, neighbors.indices + k, x, y, z, density);
            Floats factor = load(neighbors.gradient_factors + k) * reciprocal(density);
            if constexpr (MIXTURE)
                factor = fourth<LIQUID_ROW>(liquid.rows + 4, neighbors.indices + k) == row[7] ? factor : Floats{};
            sum_x += factor * (x - row[0]), sum_y += factor * (y - row[1]), sum_z += factor * (z - row[2]);
        }
        row[4] = scale * sum(sum_x), row[5] = scale * sum(sum_y), row[6] = scale * sum(sum_z);
    }
}

void find_surface_normals(const Frame& frame, int32_t begin, int32_t end) {
    frame.masses ? find_surface_normals_of<true>(frame, begin, end) : find_surface_normals_of<false>(frame, begin, end);
}

// Changes velocities by cohesion and by the differences of surface normals, in a MIXTURE within each liquid.
template <bool MIXTURE>
inline void apply_tension_of(const Frame& frame, int32_t begin, int32_t end) {
    const LiquidFrame& liquid = *frame.liquid;
    const float shrink = 1.0f / frame.parameters->kernel_support, time = frame.parameters->substep_time();
    for (int32_t i = begin; i < end; ++i) {
        const Neighbors& neighbors = frame.neighbors[i];
        const LiquidParameters& parameters = liquid_at(liquid, i);
        const float* row = liquid.rows + LIQUID_ROW * static_cast<int64_t>(i);
        Floats sum_x{}, sum_y{}, sum_z{};
        for (int32_t k = 0; k < neighbors.padded_count; k += LANES) {
            Floats x, y, z, density, nx, ny, nz, number;
            pick_four<LIQUID_ROW>(liquid.rows, neighbors.indices + k, x, y, z, density);
            pick_four<LIQUID_ROW>(liquid.rows + 4, neighbors.indices + k, nx, ny, nz, number);
            x = (x - row[0]) * shrink, y = (y - row[1]) * shrink, z = (z - row[2]) * shrink;
            const Floats square = at_least(x * x + y * y + z * z, 1e-12f), inverse = reciprocal_root(square),
                         distance = square * inverse;
            Floats weight = distance < 1.0f ? 2.0f * reciprocal(density + row[3]) : Floats{};
            if constexpr (MIXTURE) weight = number == row[7] ? weight : Floats{};
            const Floats pull = weight * parameters.cohesion * cohesion_at(distance) * inverse,
                         turn = weight * parameters.curvature;
            sum_x += pull * x + turn * (nx - row[4]);
            sum_y += pull * y + turn * (ny - row[5]);
            sum_z += pull * z + turn * (nz - row[6]);
        }
        const float change[3] = {time * sum(sum_x), time * sum(sum_y), time * sum(sum_z)};
        float* velocity = frame.motion + MOTION_ROW * static_cast<int64_t>(i) + 4;
        for (int axis = 0; axis < 3; ++axis) {
            velocity[axis] += change[axis];
            frame.work[i].delta_velocity[axis] += change[axis];
        }
    }
}

void apply_tension(const Frame& frame, int32_t begin, int32_t end) {
    frame.masses ? apply_tension_of<true>(frame, begin, end) : apply_tension_of<false>(frame, begin, end);
}

// The pair coefficients of the matrix I - Δt L, in place of the kernels' gradient factors, and its block on the diagonal. In a
// MIXTURE every row is multiplied by the mass of its particle, so that the matrix is symmetric, and the dynamic viscosity of
// two liquids is their harmonic mean, that of two layers in a shear.
template <bool MIXTURE>
inline void prepare_viscosity_of(const Frame& frame, int32_t begin, int32_t end) {
    const SolverParameters& p = *frame.parameters;
    const LiquidFrame& liquid = *frame.liquid;
    const float shrink = 1.0f / p.kernel_support;
    const float viscosity = MIXTURE ? 2.0f : liquid.parameters->viscosity;
    const float scale = p.substep_time() * viscosity * p.gradient_scale() / p.kernel_support;
    for (int32_t i = begin; i < end; ++i) {
        const Neighbors& neighbors = frame.neighbors[i];
        const float* row = liquid.rows + LIQUID_ROW * static_cast<int64_t>(i);
        const float* friction = liquid.friction + FRICTION_ROW * static_cast<int64_t>(i);
        Floats xx{}, yy{}, zz{}, xy{}, xz{}, yz{};
        for (int32_t k = 0; k < neighbors.padded_count; k += LANES) {
            Floats x, y, z, density;
            pick_four<LIQUID_ROW>(liquid.rows, neighbors.indices + k, x, y, z, density);
            x = (x - row[0]) * shrink, y = (y - row[1]) * shrink, z = (z - row[2]) * shrink;
            Floats factor = scale * load(neighbors.gradient_factors + k) *
                            reciprocal((x * x + y * y + z * z + p.viscosity_softening) * density * row[3]);
            if constexpr (MIXTURE) {
                const Floats other = fourth<LIQUID_ROW>(liquid.rows + 4, neighbors.indices + k);
                factor *= other * row[7] * reciprocal(other + row[7] + 1e-12f);
            }
            store(neighbors.gradient_factors + k, factor);
            xx += factor * x * x, yy += factor * y * y, zz += factor * z * z;
            xy += factor * x * y, xz += factor * x * z, yz += factor * y * z;
        }
        const float time = p.substep_time(), mass = MIXTURE ? frame.masses[i] : 1.0f;
        const float a = mass + sum(xx) + time * friction[0], b = mass + sum(yy) + time * friction[1],
                    c = mass + sum(zz) + time * friction[2], d = sum(xy) + time * friction[3], e = sum(xz) + time * friction[4],
                    f = sum(yz) + time * friction[5];
        const float minor_x = b * c - f * f, minor_y = e * f - d * c, minor_z = d * f - b * e;
        const float inverse = 1.0f / (a * minor_x + d * minor_y + e * minor_z);
        float* block = liquid.inverse_diagonal + SYMMETRIC * static_cast<int64_t>(i);
        block[0] = inverse * minor_x, block[1] = inverse * (a * c - e * e), block[2] = inverse * (a * b - d * d);
        block[3] = inverse * minor_y, block[4] = inverse * minor_z, block[5] = inverse * (d * e - a * f);
    }
}

void prepare_viscosity(const Frame& frame, int32_t begin, int32_t end) {
    frame.masses ? prepare_viscosity_of<true>(frame, begin, end) : prepare_viscosity_of<false>(frame, begin, end);
}

// Writes the matrix times the vectors in the rows, and returns the scalar product of both.
double multiply_viscosity(const Frame& frame, int32_t begin, int32_t end) {
    const LiquidFrame& liquid = *frame.liquid;
    const float shrink = 1.0f / frame.parameters->kernel_support, time = frame.parameters->substep_time();
    double total = 0.0;
    for (int32_t i = begin; i < end; ++i) {
        const Neighbors& neighbors = frame.neighbors[i];
        const float* row = liquid.rows + LIQUID_ROW * static_cast<int64_t>(i);
        const float* friction = liquid.friction + FRICTION_ROW * static_cast<int64_t>(i);
        Floats sum_x{}, sum_y{}, sum_z{};
        for (int32_t k = 0; k < neighbors.padded_count; k += LANES) {
            Floats x, y, z, px, py, pz, unused;
            pick_four<LIQUID_ROW>(liquid.rows, neighbors.indices + k, x, y, z, unused);
            pick_four<LIQUID_ROW>(liquid.rows + 4, neighbors.indices + k, px, py, pz, unused);
            x = (x - row[0]) * shrink, y = (y - row[1]) * shrink, z = (z - row[2]) * shrink;
            const Floats pair =
                load(neighbors.gradient_factors + k) * (x * (row[4] - px) + y * (row[5] - py) + z * (row[6] - pz));
            sum_x += pair * x, sum_y += pair * y, sum_z += pair * z;
        }
        const float *v = row + 4, mass = liquid_at(liquid, i).mass;
        float* product = liquid.product + 3 * static_cast<int64_t>(i);
        product[0] = mass * v[0] + sum(sum_x) + time * (friction[0] * v[0] + friction[3] * v[1] + friction[4] * v[2]);
        product[1] = mass * v[1] + sum(sum_y) + time * (friction[3] * v[0] + friction[1] * v[1] + friction[5] * v[2]);
        product[2] = mass * v[2] + sum(sum_z) + time * (friction[4] * v[0] + friction[5] * v[1] + friction[2] * v[2]);
        total += static_cast<double>(dot(v, product));
    }
    return total;
}

// Adds the impulses of friction and adhesion on solids and walls to `rows`.
void sum_liquid_impulses(const Frame& frame, const ImpulseSums& sums, int32_t begin, int32_t end, double* rows) {
    const SolverParameters& p = *frame.parameters;
    const LiquidFrame& liquid = *frame.liquid;
    for (int32_t i = begin; i < end; ++i) {
        const float* row = liquid.rows + LIQUID_ROW * static_cast<int64_t>(i);
        const float* velocity = liquid.solution + 3 * static_cast<int64_t>(i);
        const LiquidParameters& parameters = liquid_at(liquid, i);
        const float time = parameters.implicit_viscosity ? p.substep_time() / row[3] : 0.0f;
        float min_solid_distance = frame.work[i].min_solid_distance;
        for_each_contact(frame, i, row, min_solid_distance, [&](const Contact& contact) {
            float along, across, relative[3];
            friction_at(p, parameters, contact, along, across);
            for (int axis = 0; axis < 3; ++axis) relative[axis] = time > 0.0f ? velocity[axis] - contact.velocity[axis] : 0.0f;
            const float normal = time * (along - across) * dot(contact.normal, relative) + adhesion_of(p, parameters, contact);
            double impulse[3];
            for (int axis = 0; axis < 3; ++axis)
                impulse[axis] =
                    parameters.mass * static_cast<double>(time * across * relative[axis] + normal * contact.normal[axis]);
            const int32_t target = contact.solid == WALLS   ? 0
                                   : contact.solid == STILL ? sums.still_row(frame.order[i])
                                                            : sums.moving_row(contact.solid);
            add_impulse(rows + IMPULSE_ROW * static_cast<int64_t>(target), row, impulse);
        });
    }
}

}  // namespace
}  // namespace ISA
