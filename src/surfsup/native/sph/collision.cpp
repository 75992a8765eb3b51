#include "sph/collision.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "sph/collision_steps.hpp"
#include "sph/crossing.hpp"

namespace surfsup {
namespace {

// Distances and normals of some of the particles.
struct SubsetQuery {
    std::vector<float> points, distance, normal;

    void run(const SolidQuery& solid, const float* positions, const std::vector<int32_t>& subset, bool with_normal) {
        points.clear();
        for (const int32_t i : subset)
            points.insert(points.end(), positions + 3 * static_cast<int64_t>(i), positions + 3 * static_cast<int64_t>(i) + 3);
        distance.resize(subset.size()), normal.resize(points.size());
        solid(points.data(), static_cast<int32_t>(subset.size()), distance.data(), with_normal ? normal.data() : nullptr);
    }
};

}  // namespace

void update_query(const float* positions, int32_t count, const CollisionParameters& parameters, const SolidQuery& solid,
                  const LastQuery& last_query, float* lower_bound) {
    const std::vector<int32_t> near = possibly_near(positions, last_query, count, parameters);
    if (!near.empty()) {
        SubsetQuery query;
        query.run(solid, positions, near, false);
        for (size_t k = 0; k < near.size(); ++k) {
            const int64_t i = near[k];
            for (int64_t at = 3 * i; at < 3 * i + 3; ++at) last_query.positions[at] = positions[at];
            last_query.distance[i] = query.distance[k];
        }
    }
    for (int64_t i = 0; i < count; ++i)
        lower_bound[i] = last_query.distance[i] -
                         parameters.lipschitz_bound * distance_between(last_query.positions + 3 * i, positions + 3 * i);
}

void resolve_collisions(const float* before, float* positions, float* velocities, bool* collided, int32_t count,
                        const Container& container, const CollisionParameters& parameters, const SolidQuery& solid,
                        const LastQuery* last_query, const ImpulseSums* impulses) {
    float lower[3], upper[3];
    for (int axis = 0; axis < 3; ++axis)
        lower[axis] = container.lower[axis] + parameters.clearance, upper[axis] = container.upper[axis] - parameters.clearance;
    for (int64_t i = 0; i < count; ++i) {
        VelocityWatch watch(impulses, i, positions + 3 * i, velocities + 3 * i);
        collided[i] = contain(positions + 3 * i, velocities + 3 * i, lower, upper);
        if (collided[i]) watch.add_to(0);
    }
    if (!solid) return;
    for (const int32_t i : stop_crossings(solid, last_query, before, positions, count, parameters)) collided[i] = true;
    std::vector<int32_t> active;
    if (last_query) {
        active = possibly_near(positions, *last_query, count, parameters);
    } else {
        active.resize(static_cast<size_t>(count));
        std::iota(active.begin(), active.end(), 0);
    }
    SubsetQuery query;
    for (int round = 0; round < parameters.rounds && !active.empty(); ++round) {
        query.run(solid, positions, active, true);
        std::vector<int32_t> projected;
        for (size_t k = 0; k < active.size(); ++k) {
            const float depth = parameters.clearance - query.distance[k];
            if (!(depth > parameters.tolerance)) continue;
            const int64_t i = active[k];
            VelocityWatch watch(impulses, i, positions + 3 * i, velocities + 3 * i);
            project(positions + 3 * i, velocities + 3 * i, depth, query.normal.data() + 3 * k);
            if (impulses) watch.add_to(impulses->still_row(i));
            contain(positions + 3 * i, velocities + 3 * i, lower, upper);
            watch.add_to(0);
            collided[i] = true;
            projected.push_back(active[k]);
        }
        active = std::move(projected);
    }
    if (active.empty()) return;
    query.run(solid, positions, active, false);
    for (size_t k = 0; k < active.size(); ++k) {
        if (!(query.distance[k] < 0)) continue;
        const int64_t i = active[k];
        VelocityWatch watch(impulses, i, positions + 3 * i, velocities + 3 * i);
        for (int64_t at = 3 * i, end = at + 3; at < end; ++at) positions[at] = before[at], velocities[at] = 0;
        if (impulses) watch.add_to(impulses->still_row(i));
    }
}

double energy_gain(const float* positions, const float* velocities, const float* new_positions, const float* new_velocities,
                   int64_t count, const float* gravity, const float* masses) {
    double gain = 0;
    for (int64_t i = 0; i < 3 * count; i += 3) {
        float kinetic = 0, work = 0;
        for (int axis = 0; axis < 3; ++axis) {
            const float before = velocities[i + axis], after = new_velocities[i + axis];
            kinetic += 0.5f * (after - before) * (after + before);
            work += (new_positions[i + axis] - positions[i + axis]) * gravity[axis];
        }
        gain += masses ? masses[i / 3] * (kinetic - work) : kinetic - work;
    }
    return count ? gain / total_mass(masses, count) : 0;
}

void limit_energy_gain(const float* positions, const float* velocities, const Ballistic& ballistic, float* new_positions,
                       float* new_velocities, int64_t count, const float* gravity, const float* masses,
                       const EnergyLimit& limit) {
    const std::vector<float> after(new_positions, new_positions + 3 * count), fast(new_velocities, new_velocities + 3 * count);
    float bound = limit.max_delta_velocity;
    for (int halving = 0; halving < limit.halvings; ++halving) {
        if (!(energy_gain(positions, velocities, new_positions, new_velocities, count, gravity, masses) > limit.max_gain))
            return;
        bound /= 2;
        for (int64_t i = 0; i < 3 * count; i += 3) {
            float delta[3];
            for (int axis = 0; axis < 3; ++axis)
                delta[axis] = fast[static_cast<size_t>(i + axis)] - ballistic.velocities[i + axis];
            const float speed = std::sqrt(delta[0] * delta[0] + delta[1] * delta[1] + delta[2] * delta[2]);
            const float fraction = speed > bound ? bound / speed : 1;
            for (int64_t at = i; at < i + 3; ++at) {
                const float free_position = ballistic.positions[at];
                new_positions[at] = free_position + fraction * (after[static_cast<size_t>(at)] - free_position);
                new_velocities[at] = ballistic.velocities[at] + fraction * delta[at - i];
            }
        }
    }
    if (!(energy_gain(positions, velocities, new_positions, new_velocities, count, gravity, masses) > limit.max_gain)) return;
    std::copy(ballistic.positions, ballistic.positions + 3 * count, new_positions);
    std::copy(ballistic.velocities, ballistic.velocities + 3 * count, new_velocities);
}

}  // namespace surfsup
