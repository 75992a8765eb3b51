// Interpolation in a boundary volume map, compiled once for every instruction set.
#pragma once

#include "isa/lanes.hpp"
#include "sph/boundary_map.hpp"

namespace ISA {
namespace {

using surfsup::BoundaryMapView;
using surfsup::NODES;

// Local coordinates of a group of eight nodes: the corners, or the edges along one axis with two nodes each.
constexpr Eight CORNER_X = {-1, 1, -1, 1, -1, 1, -1, 1}, CORNER_Y = {-1, -1, 1, 1, -1, -1, 1, 1};
constexpr Eight CORNER_Z = {-1, -1, -1, -1, 1, 1, 1, 1};
constexpr float THIRD = 1.0f / 3.0f;
constexpr Eight INNER = {-THIRD, THIRD, -THIRD, THIRD, -THIRD, THIRD, -THIRD, THIRD};
constexpr Eight FIRST = {-1, -1, -1, -1, 1, 1, 1, 1}, SECOND = {-1, -1, 1, 1, -1, -1, 1, 1};

inline Eight load_eight(const float* from) {
    Eight values;
    std::memcpy(&values, from, sizeof values);
    return values;
}

// Partial sums over the nodes of a cell: distance, volume fraction, gradient of the distance.
struct NodeSums {
    Eight distance{}, fraction{}, gradient[3]{};
};

inline void add_nodes(const float* nodes, Eight shape, Eight along, Eight first, Eight second, int axis, int one, int other,
                      NodeSums& sums) {
    const Eight distance = load_eight(nodes);
    sums.distance += shape * distance;
    sums.fraction += shape * load_eight(nodes + NODES);
    sums.gradient[axis] += along * distance;
    sums.gradient[one] += first * distance;
    sums.gradient[other] += second * distance;
}

// Adds the nodes on the edges along `axis`; `one` and `other` are the axes across, in the order of the nodes.
inline void add_edges(const float* nodes, const float* local, int axis, int one, int other, NodeSums& sums) {
    const float bubble = 1.0f - local[axis] * local[axis];
    const Eight third = 1.0f + 9.0f * INNER * local[axis];
    const Eight along = 9.0f / 64.0f * (bubble * 9.0f * INNER - 2.0f * local[axis] * third),
                value = 9.0f / 64.0f * bubble * third;
    const Eight of_one = 1.0f + FIRST * local[one], of_other = 1.0f + SECOND * local[other];
    add_nodes(nodes, value * of_one * of_other, along * of_one * of_other, value * FIRST * of_other, value * of_one * SECOND,
              axis, one, other, sums);
}

// Signed distance in meters, volume fraction and unit normal of the solid at a position.
inline void interpolate(const BoundaryMapView& map, const float* position, float& distance, float& fraction, float* normal) {
    float local[3];
    int64_t number = 0, stride = 1;
    bool inside = true;
    for (int axis = 0; axis < 3; ++axis) {
        const float rotated =
            position[0] * map.rotation[axis] + position[1] * map.rotation[3 + axis] + position[2] * map.rotation[6 + axis];
        const float cells = (rotated - map.lower[axis]) * map.cells_per_meter[axis];
        inside = inside && cells >= 0.0f && cells < static_cast<float>(map.resolution[axis]);
        const int32_t index = inside ? static_cast<int32_t>(cells) : 0;
        local[axis] = inside ? 2.0f * (cells - static_cast<float>(index)) - 1.0f : 0.0f;
        number += stride * index;
        stride *= map.resolution[axis];
    }
    const int32_t stored = inside ? map.cell_indices[number] : -1;
    if (stored < 0) {
        distance = map.nodes[2 * NODES * map.last_cell];
        for (int axis = 0; axis < 3; ++axis) {
            if (position[axis] != position[axis]) distance = position[axis];
            normal[axis] = 0.0f;
        }
        fraction = 0.0f;
        return;
    }
    const float* nodes = map.nodes + 2 * NODES * static_cast<int64_t>(stored);
    const float radial = 9.0f * (local[0] * local[0] + local[1] * local[1] + local[2] * local[2]) - 19.0f;
    const Eight x = 1.0f + CORNER_X * local[0], y = 1.0f + CORNER_Y * local[1], z = 1.0f + CORNER_Z * local[2], all = x * y * z;
    NodeSums nodal;
    constexpr float PART = 1.0f / 64.0f;
    add_nodes(nodes, PART * all * radial, PART * (CORNER_X * y * z * radial + all * (18.0f * local[0])),
              PART * (CORNER_Y * x * z * radial + all * (18.0f * local[1])),
              PART * (CORNER_Z * x * y * radial + all * (18.0f * local[2])), 0, 1, 2, nodal);
    add_edges(nodes + 8, local, 0, 1, 2, nodal);
    add_edges(nodes + 16, local, 1, 2, 0, nodal);
    add_edges(nodes + 24, local, 2, 0, 1, nodal);
    float sums[8];
    sum_each(
        {nodal.distance, nodal.fraction, nodal.gradient[0], nodal.gradient[1], nodal.gradient[2], Eight{}, Eight{}, Eight{}},
        sums);
    distance = sums[0];
    fraction = sums[1];
    float gradient[3], square = 0.0f;
    for (int axis = 0; axis < 3; ++axis) {
        gradient[axis] = sums[2 + axis] * map.cells_per_meter[axis];
        square += gradient[axis] * gradient[axis];
    }
    const float scale = 1.0f / (__builtin_sqrtf(square) + 1e-12f);
    for (int axis = 0; axis < 3; ++axis)
        normal[axis] = scale * (map.rotation[3 * axis] * gradient[0] + map.rotation[3 * axis + 1] * gradient[1] +
                                map.rotation[3 * axis + 2] * gradient[2]);
}

}  // namespace
}  // namespace ISA
