// Collision handling and the energy balance of a frame. Arrays of particles are (count, 3); positions in meters, velocities in
// m/s.
#pragma once

#include <cstdint>
#include <functional>

#include "sph/impulses.hpp"
#include "sph/parameters.hpp"

namespace surfsup {

// Queries a solid for the signed distance (count) and, unless null, the unit normal (count, 3) of points (count, 3). The points
// belong to the caller but are not const, since torch takes writable memory only.
using SolidQuery = std::function<void(float* points, int32_t count, float* distance, float* normal)>;

// Where each particle last queried the solid (count, 3), and its distance there (count), meters.
struct LastQuery {
    float *positions, *distance;
};

struct Container {
    const float *lower, *upper;
};

// Queries the solid for those particles at `positions` that may be nearer than the clearance according to their last query,
// which is updated. Writes a lower bound of the distance of all particles (count).
void update_query(const float* positions, int32_t count, const CollisionParameters& parameters, const SolidQuery& solid,
                  const LastQuery& last_query, float* lower_bound);

// Moves particles out of solid and walls in place, see sph/collision.py, and marks them in `collided` (count). `before` are the
// positions at the frame's start. `solid` may be empty; without `last_query` every particle queries it. Adds to `impulses`
// unless it is null.
void resolve_collisions(const float* before, float* positions, float* velocities, bool* collided, int32_t count,
                        const Container& container, const CollisionParameters& parameters, const SolidQuery& solid,
                        const LastQuery* last_query, const ImpulseSums* impulses);

// The mass of particles with `masses` (count); null for masses of 1.
inline double total_mass(const float* masses, int64_t count) {
    if (!masses) return static_cast<double>(count);
    double total = 0;
    for (int64_t i = 0; i < count; ++i) total += masses[i];
    return total;
}

// Mechanical energy that a frame adds, mean J/kg, see sph/energy.py. `masses` are null where all are equal.
double energy_gain(const float* positions, const float* velocities, const float* new_positions, const float* new_velocities,
                   int64_t count, const float* gravity, const float* masses);

// The energy limiter, see sph/energy.py.
struct EnergyLimit {
    double max_gain;           // J/kg in a frame
    float max_delta_velocity;  // m/s, halved until the gain is small enough
    int halvings;              // at most
};

// Positions and velocities (count, 3) after a frame of free fall.
struct Ballistic {
    const float *positions, *velocities;
};

// Shortens in place the changes against free fall that add too much energy.
void limit_energy_gain(const float* positions, const float* velocities, const Ballistic& ballistic, float* new_positions,
                       float* new_velocities, int64_t count, const float* gravity, const float* masses,
                       const EnergyLimit& limit);

}  // namespace surfsup
