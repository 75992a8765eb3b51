#include "sdf/mesh_shape.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace surfsup {
namespace {

constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();

double length(const Point& v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

Point scaled(const Point& v, double scale) { return {v[0] * scale, v[1] * scale, v[2] * scale}; }

bool contains(const SdfGrid<double>& grid, const Point& point) {
    for (size_t axis = 0; axis < 3; ++axis)
        if (!(point[axis] >= grid.lower[axis] && point[axis] <= upper_corner(grid, axis))) return false;
    return true;
}

// Distance and unit normal of a point outside the bounding box of the mesh, from the nearest point on the grid's border.
double extrapolate(const SdfGrid<double>& grid, const Point& point, Point& normal) {
    Point border, gradient, away;
    for (size_t axis = 0; axis < 3; ++axis)
        border[axis] = std::min(std::max(point[axis], grid.lower[axis]), upper_corner(grid, axis));
    const double distance = interpolate(grid, border, gradient), slope = length(gradient),
                 scale = slope > 0 ? distance / slope : 0;
    for (size_t axis = 0; axis < 3; ++axis) away[axis] = point[axis] - border[axis] + scale * gradient[axis];
    const double far_distance = length(away);
    normal = scaled(away, far_distance > 0 ? 1 / far_distance : 1);
    return far_distance;
}

// Signed distance by the triangles. It is at most that to the nearest node plus that of the node from the surface. As long as
// the node is nearer than the surface, both points are on the same side.
double query_triangles(const MeshDistance& mesh, const Point& point, Point& normal) {
    const SdfGrid<double>& grid = mesh.fine;
    double squared = 0;
    int64_t index = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
        const double position = (point[axis] - grid.lower[axis]) / grid.cell, node = std::rint(position);
        index = index * grid.nodes[axis] + std::clamp<int64_t>(static_cast<int64_t>(node), 0, grid.nodes[axis] - 1);
        squared += (position - node) * (position - node);
    }
    const double to_node = std::sqrt(squared) * grid.cell, node_distance = mesh.node_distance[index];
    const auto [distance, face, closest] = mesh.bvh->nearest(point, to_node + std::abs(node_distance));
    if (to_node >= distance || distance < mesh.on_surface) return NOT_A_NUMBER;
    const double sign = std::signbit(node_distance) ? -1 : 1;
    for (size_t axis = 0; axis < 3; ++axis) normal[axis] = (point[axis] - closest[axis]) * (sign / distance);
    return sign * distance;
}

double signed_distance(const MeshDistance& mesh, const Point& point, Point& normal) {
    if (!std::isfinite(point[0] + point[1] + point[2])) return NOT_A_NUMBER;
    if (!contains(mesh.fine, point)) return extrapolate(mesh.coarse, point, normal);
    Point gradient;
    const double distance = interpolate(mesh.fine, point, gradient), agreement = length(gradient);
    if (std::abs(distance) < mesh.mesh_range || agreement < mesh.min_agreement) return query_triangles(mesh, point, normal);
    normal = scaled(gradient, 1 / agreement);
    return distance;
}

}  // namespace

void MeshShape::sample(const Isa&, const float* points, int32_t count, const Samples& samples, int32_t*, float*) const {
    for (int64_t i = 0; i < count; ++i) {
        Point normal{NOT_A_NUMBER, NOT_A_NUMBER, NOT_A_NUMBER};
        const Point point{points[3 * i], points[3 * i + 1], points[3 * i + 2]};
        samples.rows[i] = static_cast<float>(signed_distance(*mesh_, point, normal));
        if (!samples.with_normal) continue;
        for (int64_t axis = 0; axis < 3; ++axis)
            samples.rows[(1 + axis) * samples.stride + i] = static_cast<float>(normal[static_cast<size_t>(axis)]);
    }
}

}  // namespace surfsup
