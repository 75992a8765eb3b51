#include "sph/collision.hpp"

#include <cmath>
#include <numeric>
#include <vector>

namespace surfsup {
namespace {

// A learned distance may exaggerate: it is believed half, or what comes to the same, a way counts twice.
constexpr float BELIEVED = 2.0f;

// One particle is brought between the walls, and what of its velocity points out taken away; whether it had to be moved.
bool contain(float* position, float* velocity, const float* lower, const float* upper) {
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

// One particle that lacks so many meters is pushed out along the normal, and what of its velocity points in taken away.
void push(float* position, float* velocity, float missing, const float* normal) {
    const float speed = velocity[0] * normal[0] + velocity[1] * normal[1] + velocity[2] * normal[2];
    const float inward = speed > 0 ? 0 : speed;
    for (int axis = 0; axis < 3; ++axis) {
        position[axis] += missing * normal[axis];
        velocity[axis] -= inward * normal[axis];
    }
}

float way(const float* from, const float* to) {
    const float x = to[0] - from[0], y = to[1] - from[1], z = to[2] - from[2];
    return std::sqrt(x * x + y * y + z * z);
}

// Particles that may be nearer than `clearance` to the solid; what is no number may be anywhere.
std::vector<int32_t> within_reach(const float* positions, const float* places, const float* distance, int32_t count, float clearance) {
    std::vector<int32_t> found;
    for (int32_t i = 0; i < count; ++i) {
        const int64_t at = 3 * static_cast<int64_t>(i);
        if (!(BELIEVED * way(places + at, positions + at) < distance[i] - clearance)) found.push_back(i);
    }
    return found;
}

// What the solid tells of some of the particles.
struct Looked {
    std::vector<float> points, distance, normal;

    void ask(const Ask& solid, const float* positions, const std::vector<int32_t>& at, bool with_normal) {
        points.clear();
        for (const int32_t i : at) points.insert(points.end(), positions + 3 * static_cast<int64_t>(i), positions + 3 * static_cast<int64_t>(i) + 3);
        distance.resize(at.size()), normal.resize(points.size());
        solid(points.data(), static_cast<int32_t>(at.size()), distance.data(), with_normal ? normal.data() : nullptr);
    }
};

}  // namespace

void look_again(const float* ahead, int32_t count, float clearance, const Ask& ask, float* places, float* distance, float* at_least) {
    const std::vector<int32_t> near = within_reach(ahead, places, distance, count, clearance);
    if (!near.empty()) {
        Looked looked;
        looked.ask(ask, ahead, near, false);
        for (size_t k = 0; k < near.size(); ++k) {
            const int64_t i = near[k];
            for (int64_t at = 3 * i; at < 3 * i + 3; ++at) places[at] = ahead[at];
            distance[i] = looked.distance[k];
        }
    }
    for (int64_t i = 0; i < count; ++i) at_least[i] = distance[i] - BELIEVED * way(places + 3 * i, ahead + 3 * i);
}

void guard(const float* before, float* positions, float* velocities, bool* moved, int32_t count, const Clearance& clearance,
           const Ask& ask, const float* places, const float* distance) {
    float lower[3], upper[3];
    for (int axis = 0; axis < 3; ++axis) lower[axis] = clearance.lower[axis] + clearance.meters, upper[axis] = clearance.upper[axis] - clearance.meters;
    const auto contain_one = [&](int64_t i) { return contain(positions + 3 * i, velocities + 3 * i, lower, upper); };
    for (int64_t i = 0; i < count; ++i) moved[i] = contain_one(i);
    if (!ask) return;
    std::vector<int32_t> at;
    if (places) {
        at = within_reach(positions, places, distance, count, clearance.meters);
    } else {
        at.resize(static_cast<size_t>(count));
        std::iota(at.begin(), at.end(), 0);
    }
    Looked looked;
    for (int round = 0; round < clearance.rounds && !at.empty(); ++round) {
        looked.ask(ask, positions, at, true);
        std::vector<int32_t> pushed;
        for (size_t k = 0; k < at.size(); ++k) {
            const float missing = clearance.meters - looked.distance[k];
            if (!(missing > clearance.tolerance)) continue;
            const int64_t i = at[k];
            push(positions + 3 * i, velocities + 3 * i, missing, looked.normal.data() + 3 * k);
            contain_one(i);
            moved[i] = true;
            pushed.push_back(at[k]);
        }
        at = std::move(pushed);
    }
    if (at.empty()) return;
    looked.ask(ask, positions, at, false);
    for (size_t k = 0; k < at.size(); ++k) {
        if (!(looked.distance[k] < 0)) continue;
        for (int64_t here = 3 * static_cast<int64_t>(at[k]), end = here + 3; here < end; ++here) positions[here] = before[here], velocities[here] = 0;
    }
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
