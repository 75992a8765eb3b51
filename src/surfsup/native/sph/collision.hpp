// What happens to every particle besides the step itself: the look at the solid, the guard, the account of energy.
// Of all arrays, those of particles are (count, 3); positions in meters, velocities in m/s.
#pragma once

#include <cstdint>
#include <functional>

namespace surfsup {

// Asks a solid for the distance (count) and unit normal (count, 3), unless that is null, of points (count, 3), which belong to
// whoever asks: torch takes nothing that may not be written.
using Ask = std::function<void(float* points, int32_t count, float* distance, float* normal)>;

// How close to solid and walls a particle may come.
struct Clearance {
    const float *lower, *upper;  // corners of the container
    float meters, tolerance;     // from walls and solid to a particle's middle, and how short of it from a solid it may stay
    int rounds;                  // pushes at most
};

// Asks about those particles that, now `ahead`, may be nearer than `clearance` to the solid, having been `distance` (count)
// from it at `places`; both become those of now. `at_least` (count): how far the solid is off `ahead`, or farther.
void look_again(const float* ahead, int32_t count, float clearance, const Ask& ask, float* places, float* distance, float* at_least);

// The guard, see guard.py; in place, and marks whom it `moved` (count). `ask` may be empty; so may `places` and `distance` be
// null: then every particle is looked at.
void guard(const float* before, float* positions, float* velocities, bool* moved, int32_t count, const Clearance& clearance,
           const Ask& ask, const float* places, const float* distance);

// How much mechanical energy a step adds, mean J/kg: see energy.py.
double energy_gain(const float* positions, const float* velocities, const float* new_positions, const float* new_velocities,
                   int64_t count, const float* gravity);

}  // namespace surfsup
