#include "guard.hpp"

namespace surfsup {
namespace {

// One particle; whether it had to be moved.
bool contain_one(float* position, float* velocity, const float* lower, const float* upper) {
    bool crossed = false;
    for (int axis = 0; axis < 3; ++axis) {
        const float place = position[axis];
        const float inside = place < lower[axis] ? lower[axis] : place > upper[axis] ? upper[axis] : place;
        if (inside == place) continue;
        crossed = true;  // or no number
        if (velocity[axis] * (inside - place) < 0) velocity[axis] = 0;
        position[axis] = inside;
    }
    return crossed;
}

}  // namespace

void contain(float* positions, float* velocities, bool* moved, int64_t count, const float* lower, const float* upper) {
    for (int64_t i = 0; i < count; ++i) moved[i] = contain_one(positions + 3 * i, velocities + 3 * i, lower, upper);
}

std::vector<int64_t> push(float* positions, float* velocities, bool* moved, const int64_t* at, int64_t size,
                          const float* distance, const float* normal, const float* lower, const float* upper,
                          float clearance, float tolerance) {
    std::vector<int64_t> pushed;
    for (int64_t k = 0; k < size; ++k) {
        const float missing = clearance - distance[k];
        if (!(missing > tolerance)) continue;
        float *position = positions + 3 * at[k], *velocity = velocities + 3 * at[k];
        const float* out = normal + 3 * k;
        const float speed = velocity[0] * out[0] + velocity[1] * out[1] + velocity[2] * out[2];
        const float inward = speed > 0 ? 0 : speed;
        for (int axis = 0; axis < 3; ++axis) {
            position[axis] += missing * out[axis];
            velocity[axis] -= inward * out[axis];
        }
        contain_one(position, velocity, lower, upper);
        moved[at[k]] = true;
        pushed.push_back(at[k]);
    }
    return pushed;
}

std::vector<int64_t> within_reach(const float* positions, const float* places, const float* distance, int64_t count,
                                  float clearance) {
    std::vector<int64_t> found;
    for (int64_t i = 0; i < count; ++i) {
        float square = 0;
        for (int64_t at = 3 * i; at < 3 * i + 3; ++at) square += (positions[at] - places[at]) * (positions[at] - places[at]);
        const float spare = distance[i] - clearance;
        // A learned distance may exaggerate, and is believed half; what is no number may be anywhere.
        if (!(spare > 0 && 4 * square < spare * spare)) found.push_back(i);
    }
    return found;
}

double energy_gain(const float* positions, const float* velocities, const float* new_positions, const float* new_velocities,
                   int64_t count, const float* gravity) {
    double gained = 0;
    for (int64_t i = 0; i < 3 * count; i += 3) {
        float kinetic = 0, fallen = 0;
        for (int axis = 0; axis < 3; ++axis) {
            const float before = velocities[i + axis], after = new_velocities[i + axis];
            kinetic += 0.5f * (after - before) * (after + before);
            fallen += (new_positions[i + axis] - positions[i + axis]) * gravity[axis];
        }
        gained += kinetic - fallen;
    }
    return count ? gained / static_cast<double>(count) : 0;
}

}  // namespace surfsup
