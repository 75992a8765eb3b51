// Signed distances and gradients at the nodes of a regular grid, see surfsup.sdf.grid.SdfGrid.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>

namespace surfsup {

using Point = std::array<double, 3>;

// Every node has four floats, z varying fastest: base and gradient.
template <typename Real>
struct SdfGrid {
    const float* table;  // (nodes, 4), null if there is no grid
    Real lower[3], center[3], cell;
    int64_t nodes[3];  // along each axis
};

// Signed distance and mean gradient at a point inside the grid.
double interpolate(const SdfGrid<double>& grid, const Point& point, Point& gradient);

// Signed distance (count) and mean gradient (count, 3) at points (count, 3) inside the grid.
void interpolate(const SdfGrid<double>& grid, const double* points, int32_t count, double* distance, double* gradient,
                 int threads);

// Internal linkage: every instruction set compiles its own.
namespace {

typedef float Vector4 __attribute__((vector_size(16)));

template <typename Real>
inline Real upper_corner(const SdfGrid<Real>& grid, size_t axis) {
    return grid.lower[axis] + grid.cell * static_cast<Real>(grid.nodes[axis] - 1);
}

// The trilinear mean of the table at a point inside the grid. No point, not even NaN, reads beyond the table.
template <typename Real>
inline Vector4 interpolate_table(const SdfGrid<Real>& grid, const Real* point) {
    const int64_t stride_y = grid.nodes[2], stride_x = grid.nodes[1] * grid.nodes[2];
    int64_t first[3];
    float weights[3][2];
    for (size_t axis = 0; axis < 3; ++axis) {
        const Real position = (point[axis] - grid.lower[axis]) / grid.cell, last = static_cast<Real>(grid.nodes[axis] - 2);
        first[axis] = static_cast<int64_t>(position > 0 ? (position < last ? position : last) : 0);
        weights[axis][1] = static_cast<float>(position - static_cast<Real>(first[axis]));
        weights[axis][0] = 1.0f - weights[axis][1];
    }
    const float* corner = grid.table + 4 * (first[0] * stride_x + first[1] * stride_y + first[2]);
    Vector4 mean = {};
    for (int x = 0; x < 2; ++x)
        for (int y = 0; y < 2; ++y)
            for (int z = 0; z < 2; ++z) {
                Vector4 node;
                std::memcpy(&node, corner + 4 * (x * stride_x + y * stride_y + z), sizeof node);
                mean += weights[0][x] * weights[1][y] * weights[2][z] * node;
            }
    return mean;
}

}  // namespace
}  // namespace surfsup
