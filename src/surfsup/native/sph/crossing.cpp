#include "sph/crossing.hpp"

#include <algorithm>

#include "sph/collision_steps.hpp"

namespace surfsup {
namespace {

struct Path {
    int32_t particle;
    float length, part;  // meters; how much of it is traced
    float contact;       // distance to the solid at which the path would be cut
    float cut;           // part of the path there; negative before
};

// Paths that may reach the solid, by its last query.
std::vector<Path> possible_crossings(const LastQuery* last_query, const float* before, const float* positions, int32_t count,
                                     float clearance) {
    std::vector<Path> paths;
    for (int32_t i = 0; i < count; ++i) {
        const int64_t at = 3 * static_cast<int64_t>(i);
        const float length = distance_between(before + at, positions + at);
        if (!(length > MIN_SWEPT_PATH * clearance)) continue;
        if (last_query &&
            LIPSCHITZ_BOUND * (distance_between(last_query->positions + at, before + at) + length) < last_query->distance[i])
            continue;
        paths.push_back({i, length, 0, 0, -1});
    }
    return paths;
}

float dot(const float* a, const float* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

}  // namespace

std::vector<int32_t> stop_crossings(const SolidQuery& solid, const LastQuery* last_query, const float* before, float* positions,
                                    int32_t count, float clearance) {
    std::vector<Path> paths = possible_crossings(last_query, before, positions, count, clearance), entering;
    std::vector<float> points, distance, normal;
    const auto point_on = [&](const Path& path, float part, float* point) {
        const float *from = before + 3 * static_cast<int64_t>(path.particle),
                    *to = positions + 3 * static_cast<int64_t>(path.particle);
        for (int axis = 0; axis < 3; ++axis) point[axis] = from[axis] + part * (to[axis] - from[axis]);
    };
    for (int advance = 0; !paths.empty(); ++advance) {
        points.resize(3 * paths.size()), distance.resize(paths.size());
        for (size_t k = 0; k < paths.size(); ++k) point_on(paths[k], paths[k].part, &points[3 * k]);
        solid(points.data(), static_cast<int32_t>(paths.size()), distance.data(), nullptr);
        std::vector<Path> going;
        for (size_t k = 0; k < paths.size(); ++k) {
            Path path = paths[k];
            if (advance == 0) {
                if (!(distance[k] > 0)) continue;  // it begins inside: projection moves it out
                path.contact = CONTACT_FRACTION * std::min(clearance, distance[k]);
            }
            if (distance[k] <= path.contact && path.cut < 0) path.cut = path.part;
            if (distance[k] > path.contact) path.cut = -1;  // it left again
            if (distance[k] <= std::min(TOUCH * clearance, path.contact) || advance == MAX_ADVANCES) {
                if (path.cut >= 0) entering.push_back(path);
                continue;
            }
            path.part += distance[k] / LIPSCHITZ_BOUND / path.length;
            if (path.part < 1) going.push_back(path);
        }
        paths = std::move(going);
    }
    // One that ends in front of the solid, on the side where it entered, is left to projection.
    const auto entered = entering.size();
    points.resize(6 * entered), distance.resize(2 * entered), normal.resize(6 * entered);
    for (size_t k = 0; k < entered; ++k) {
        point_on(entering[k], entering[k].cut, &points[3 * k]);
        point_on(entering[k], 1, &points[3 * (entered + k)]);
    }
    std::vector<int32_t> stopped;
    if (entering.empty()) return stopped;
    solid(points.data(), static_cast<int32_t>(2 * entered), distance.data(), normal.data());
    for (size_t k = 0; k < entered; ++k) {
        const bool behind = distance[entered + k] > clearance || dot(&normal[3 * k], &normal[3 * (entered + k)]) < 0;
        if (!behind) continue;
        std::copy_n(&points[3 * k], 3, positions + 3 * static_cast<int64_t>(entering[k].particle));
        stopped.push_back(entering[k].particle);
    }
    return stopped;
}

}  // namespace surfsup
