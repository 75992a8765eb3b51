// What every step is held to. What the guard does to every particle: see guard.py, which asks for the distances.
#pragma once

#include <cstdint>
#include <vector>

namespace surfsup {

// Of all arrays below, those of particles are (count, 3); positions in metres, velocities in m/s.

// Brings particles between `lower` and `upper` and takes away what of their velocity points out; marks whom it moved.
void contain(float* positions, float* velocities, bool* moved, int64_t count, const float* lower, const float* upper);

// Pushes the particles `at` that are short of `clearance` by more than `tolerance` out along the normal, takes away what
// of their velocity points in, contains them, marks them. `distance` and `normal` are those of `at`. Returns who that was.
std::vector<int64_t> push(float* positions, float* velocities, bool* moved, const int64_t* at, int64_t size,
                          const float* distance, const float* normal, const float* lower, const float* upper,
                          float clearance, float tolerance);

// The particles that may be nearer than `clearance` to the solid, `distance` (count) from it as they were at `places`.
std::vector<int64_t> within_reach(const float* positions, const float* places, const float* distance, int64_t count,
                                  float clearance);

// How much mechanical energy a step adds, mean J/kg: see energy.py.
double energy_gain(const float* positions, const float* velocities, const float* new_positions, const float* new_velocities,
                   int64_t count, const float* gravity);

}  // namespace surfsup
