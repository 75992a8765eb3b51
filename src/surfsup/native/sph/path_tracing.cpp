#include "sph/path_tracing.hpp"

#include <algorithm>

namespace surfsup {
namespace {

constexpr int MAX_ADVANCES = 64;          // of a particle along its path
constexpr float CONTACT_FRACTION = 0.5f;  // of the clearance or the first distance, whichever is less: a path is cut there

}  // namespace

std::vector<Path> entering_paths(const SolidQuery& solid, std::vector<Path> paths, const CollisionParameters& parameters,
                                 float touch) {
    std::vector<Path> entering;
    std::vector<float> points, distance;
    for (int advance = 0; !paths.empty(); ++advance) {
        points.resize(3 * paths.size()), distance.resize(paths.size());
        for (size_t k = 0; k < paths.size(); ++k) paths[k].point_at(paths[k].part, &points[3 * k]);
        solid(points.data(), static_cast<int32_t>(paths.size()), distance.data(), nullptr);
        std::vector<Path> going;
        for (size_t k = 0; k < paths.size(); ++k) {
            Path path = paths[k];
            if (advance == 0) {
                if (!(distance[k] > 0)) continue;
                path.contact = CONTACT_FRACTION * std::min(parameters.clearance, distance[k]);
            }
            if (distance[k] <= path.contact && path.cut < 0) path.cut = path.part;
            if (distance[k] > path.contact) path.cut = -1;  // it left again
            if (distance[k] <= std::min(touch, path.contact) || advance == MAX_ADVANCES) {
                if (path.cut >= 0) entering.push_back(path);
                continue;
            }
            path.part += distance[k] / parameters.lipschitz_bound / path.length;
            if (path.part < 1) going.push_back(path);
        }
        paths = std::move(going);
    }
    return entering;
}

}  // namespace surfsup
