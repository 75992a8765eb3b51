#include "sph/step.hpp"

#include <algorithm>
#include <limits>
#include <vector>

namespace surfsup {
namespace {

// Where ballistic motion would lead; n semi-implicit steps of h fall by n(n+1)/2·h²·g, see state.py.
void fall(const Fluid& fluid, const Constants& constants, float* ahead) {
    const float steps = static_cast<float>(constants.steps), way = steps * (steps + 1) / 2 * constants.step_time() * constants.step_time();
    for (int64_t at = 0; at < 3 * static_cast<int64_t>(fluid.count); at += 3)
        for (int axis = 0; axis < 3; ++axis)
            ahead[at + axis] = fluid.positions[at + axis] + constants.frame_time * fluid.velocities[at + axis] + way * fluid.gravity[axis];
}

}  // namespace

Outcome next_frame(Network& network, Fluid fluid, const Ask& solid, const Clearance& clearance, bool guarded,
                   double most_gain, const LastLook& last, const Reached& reached, const Isa& isa, int threads, int64_t most_edges) {
    const auto count = static_cast<size_t>(fluid.count);
    std::vector<float> ahead(3 * count), normal, distance(count, std::numeric_limits<float>::infinity());
    fall(fluid, network.constants(), ahead.data());
    if (solid && fluid.map.places) {
        // The rule feels the solid by its map, and asks for no normal; how far off it is exactly only the guard has to know,
        // of what comes near.
        look_again(ahead.data(), fluid.count, clearance.meters, solid, last.places, last.distance, distance.data());
    } else if (solid) {
        normal.resize(3 * count);
        std::copy(ahead.begin(), ahead.end(), last.places);
        solid(last.places, fluid.count, distance.data(), normal.data());
        std::copy(distance.begin(), distance.end(), last.distance);
    }
    fluid.ahead = ahead.data(), fluid.distance = distance.data(), fluid.normal = normal.data();
    std::fill_n(reached.moved, count, false);
    const int64_t edges = network.step(fluid, reached.positions, reached.velocities, isa, threads, most_edges);
    if (edges < 0 || edges > most_edges) return {edges, false};
    const double gain = energy_gain(fluid.positions, fluid.velocities, reached.positions, reached.velocities, fluid.count, fluid.gravity);
    if (gain > most_gain) return {edges, false};
    if (guarded)
        guard(fluid.positions, reached.positions, reached.velocities, reached.moved, fluid.count, clearance, solid, last.places, last.distance);
    return {edges, true};
}

}  // namespace surfsup
