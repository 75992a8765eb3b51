#include "rollout.hpp"

#include <algorithm>
#include <limits>
#include <vector>

namespace surfsup {

Outcome next_frame(Network& network, Fluid fluid, const float* drop, const Ask& solid, const Clearance& clearance, bool guarded,
                   double most_gain, const LastLook& last, const Reached& reached, const Path& path, int threads, int64_t most_edges) {
    const auto count = static_cast<size_t>(fluid.count);
    std::vector<float> ahead(3 * count), normal(3 * count), distance(count, std::numeric_limits<float>::infinity());
    fall(fluid.positions, fluid.velocities, fluid.count, network.frame_time(), drop, ahead.data());
    if (solid && fluid.map.places) {
        // The rule feels the solid by its map; how far off it is exactly only the guard has to know, of what comes near.
        look_again(ahead.data(), fluid.count, clearance.metres, solid, last.places, last.distance, distance.data());
    } else if (solid) {
        std::copy(ahead.begin(), ahead.end(), last.places);
        solid(last.places, fluid.count, distance.data(), normal.data());
        std::copy(distance.begin(), distance.end(), last.distance);
    }
    fluid.ahead = ahead.data(), fluid.distance = distance.data(), fluid.normal = normal.data();
    std::fill_n(reached.moved, count, false);
    const int64_t edges = network.step(fluid, reached.positions, reached.velocities, path, threads, most_edges);
    if (edges < 0 || edges > most_edges) return {edges, false};
    const double gain = energy_gain(fluid.positions, fluid.velocities, reached.positions, reached.velocities, fluid.count, fluid.gravity);
    if (gain > most_gain) return {edges, false};
    if (guarded)
        guard(fluid.positions, reached.positions, reached.velocities, reached.moved, fluid.count, clearance, solid, last.places, last.distance);
    return {edges, true};
}

}  // namespace surfsup
