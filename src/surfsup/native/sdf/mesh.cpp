#include "sdf/mesh.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace surfsup {
namespace {

constexpr double NO_NUMBER = std::numeric_limits<double>::quiet_NaN();

double length(const Point& v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

Point scaled(const Point& v, double scale) { return {v[0] * scale, v[1] * scale, v[2] * scale}; }

double upper(const Grid& grid, size_t axis) { return grid.lower[axis] + grid.cell * static_cast<double>(grid.nodes[axis] - 1); }

bool holds(const Grid& grid, const Point& point) {
    for (size_t axis = 0; axis < 3; ++axis)
        if (!(point[axis] >= grid.lower[axis] && point[axis] <= upper(grid, axis))) return false;
    return true;
}

// Distance and unit normal of any point outside the mesh's box, by the grid's border: see mesh_cache.py.
double reach(const Grid& grid, const Point& point, Point& normal) {
    Point border, gradient, away;
    for (size_t axis = 0; axis < 3; ++axis) border[axis] = std::min(std::max(point[axis], grid.lower[axis]), upper(grid, axis));
    const double distance = sample(grid, border, gradient), steep = length(gradient), scale = steep > 0 ? distance / steep : 0;
    for (size_t axis = 0; axis < 3; ++axis) away[axis] = point[axis] - border[axis] + scale * gradient[axis];
    const double far = length(away);
    normal = scaled(away, far > 0 ? 1 / far : 1);
    return far;
}

// By the triangles. The surface is no farther than the nearest node and what that is from it; and as long as the node is
// nearer than the surface both are on the same side.
double ask_triangles(const Mesh& mesh, const Point& point, Point& normal) {
    const Grid& grid = mesh.fine;
    double square = 0;
    int64_t number = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
        const double place = (point[axis] - grid.lower[axis]) / grid.cell, node = std::rint(place);
        number = number * grid.nodes[axis] + std::clamp<int64_t>(static_cast<int64_t>(node), 0, grid.nodes[axis] - 1);
        square += (place - node) * (place - node);
    }
    const double to_node = std::sqrt(square) * grid.cell, at_most = to_node + mesh.unsigned_distance[number];
    const auto [distance, face, closest] = mesh.triangles->nearest(point, at_most);
    if (to_node >= distance || distance < mesh.touching) return NO_NUMBER;
    const double sign = mesh.inside[number] ? -1 : 1;
    for (size_t axis = 0; axis < 3; ++axis) normal[axis] = (point[axis] - closest[axis]) * (sign / distance);
    return sign * distance;
}

double look_from(const Mesh& mesh, const Point& point, Point& normal) {
    if (!std::isfinite(point[0] + point[1] + point[2])) return NO_NUMBER;
    if (!holds(mesh.fine, point)) return reach(mesh.coarse, point, normal);
    Point gradient;
    const double distance = sample(mesh.fine, point, gradient), agreement = length(gradient);
    if (std::abs(distance) < mesh.near || agreement < mesh.agree) return ask_triangles(mesh, point, normal);
    normal = scaled(gradient, 1 / agreement);
    return distance;
}

}  // namespace

void MeshLeaf::look(const Isa&, const float* points, int32_t count, const LeafLook& to, int32_t*, float*) const {
    for (int64_t i = 0; i < count; ++i) {
        Point normal{NO_NUMBER, NO_NUMBER, NO_NUMBER};
        to.rows[i] = static_cast<float>(look_from(*mesh_, {points[3 * i], points[3 * i + 1], points[3 * i + 2]}, normal));
        if (!to.with_normal) continue;
        for (int64_t axis = 0; axis < 3; ++axis) to.rows[(1 + axis) * to.room + i] = static_cast<float>(normal[static_cast<size_t>(axis)]);
    }
}

}  // namespace surfsup
