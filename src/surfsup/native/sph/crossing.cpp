#include "sph/crossing.hpp"

#include <algorithm>

#include "sph/collision_steps.hpp"
#include "sph/path_tracing.hpp"

namespace surfsup {
namespace {

constexpr float TOUCH = 0.05f;  // of the clearance: a path so near the solid leads into it

// Paths that may reach the solid, by its last query.
std::vector<Path> possible_crossings(const LastQuery* last_query, const float* before, const float* positions, int32_t count,
                                     const CollisionParameters& parameters) {
    std::vector<Path> paths;
    for (int32_t i = 0; i < count; ++i) {
        const int64_t at = 3 * static_cast<int64_t>(i);
        const float length = distance_between(before + at, positions + at);
        if (!(length > MIN_SWEPT_PATH * parameters.clearance)) continue;
        if (last_query && parameters.lipschitz_bound * (distance_between(last_query->positions + at, before + at) + length) <
                              last_query->distance[i])
            continue;
        Path path{i, {}, {}, length};
        std::copy_n(before + at, 3, path.from);
        std::copy_n(positions + at, 3, path.to);
        paths.push_back(path);
    }
    return paths;
}

float dot(const float* a, const float* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

}  // namespace

std::vector<int32_t> stop_crossings(const SolidQuery& solid, const LastQuery* last_query, const float* before, float* positions,
                                    int32_t count, const CollisionParameters& parameters) {
    const std::vector<Path> entering = entering_paths(
        solid, possible_crossings(last_query, before, positions, count, parameters), parameters, TOUCH * parameters.clearance);
    // One that ends in front of the solid, on the side where it entered, is left to projection.
    const auto entered = entering.size();
    std::vector<float> points(6 * entered), distance(2 * entered), normal(6 * entered);
    for (size_t k = 0; k < entered; ++k) {
        entering[k].point_at(entering[k].cut, &points[3 * k]);
        entering[k].point_at(1, &points[3 * (entered + k)]);
    }
    std::vector<int32_t> stopped;
    if (entering.empty()) return stopped;
    solid(points.data(), static_cast<int32_t>(2 * entered), distance.data(), normal.data());
    for (size_t k = 0; k < entered; ++k) {
        const bool behind = distance[entered + k] > parameters.clearance || dot(&normal[3 * k], &normal[3 * (entered + k)]) < 0;
        if (!behind) continue;
        std::copy_n(&points[3 * k], 3, positions + 3 * static_cast<int64_t>(entering[k].particle));
        stopped.push_back(entering[k].particle);
    }
    return stopped;
}

}  // namespace surfsup
