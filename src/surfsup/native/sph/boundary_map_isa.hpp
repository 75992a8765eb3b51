// The look at a solid's map, compiled once a isa.
#pragma once

#include "sph/frame.hpp"
#include "isa/lanes.hpp"

namespace ISA {
namespace {

using surfsup::MapView;
using surfsup::NODES;

// Where a group of eight nodes lies: at the corners, or on the edges along one axis, two on each.
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

// Sums over a cell's nodes: distance, share, and the slope of the distance.
struct Looked {
    Eight distance{}, share{}, slope[3]{};
};

inline void add_nodes(const float* nodes, Eight function, Eight along, Eight first, Eight second, int axis, int one, int other, Looked& to) {
    const Eight distance = load_eight(nodes);
    to.distance += function * distance;
    to.share += function * load_eight(nodes + NODES);
    to.slope[axis] += along * distance;
    to.slope[one] += first * distance;
    to.slope[other] += second * distance;
}

// The edges along `axis`; `one` and `other` are the axes across, in the order that nodes have.
inline void add_edges(const float* nodes, const float* at, int axis, int one, int other, Looked& to) {
    const float bubble = 1.0f - at[axis] * at[axis];
    const Eight third = 1.0f + 9.0f * INNER * at[axis];
    const Eight along = 9.0f / 64.0f * (bubble * 9.0f * INNER - 2.0f * at[axis] * third), value = 9.0f / 64.0f * bubble * third;
    const Eight of_one = 1.0f + FIRST * at[one], of_other = 1.0f + SECOND * at[other];
    add_nodes(nodes, value * of_one * of_other, along * of_one * of_other, value * FIRST * of_other, value * of_one * SECOND, axis, one,
              other, to);
}

// Distance in meters, share of the neighborhood and normal at a place.
inline void look_up(const MapView& map, const float* place, float& distance, float& share, float* normal) {
    float at[3];
    int64_t number = 0, stride = 1;
    bool within = true;
    for (int axis = 0; axis < 3; ++axis) {
        const float turned = place[0] * map.turn[axis] + place[1] * map.turn[3 + axis] + place[2] * map.turn[6 + axis];
        const float steps = (turned - map.lower[axis]) * map.per_cell[axis];
        within = within && steps >= 0.0f && steps < static_cast<float>(map.resolution[axis]);
        const int32_t index = within ? static_cast<int32_t>(steps) : 0;
        at[axis] = within ? 2.0f * (steps - static_cast<float>(index)) - 1.0f : 0.0f;
        number += stride * index;
        stride *= map.resolution[axis];
    }
    const int32_t kept = within ? map.places[number] : -1;
    if (kept < 0) {
        distance = map.nodes[2 * NODES * map.last];
        for (int axis = 0; axis < 3; ++axis) {
            if (place[axis] != place[axis]) distance = place[axis];
            normal[axis] = 0.0f;
        }
        share = 0.0f;
        return;
    }
    const float* nodes = map.nodes + 2 * NODES * static_cast<int64_t>(kept);
    const float radial = 9.0f * (at[0] * at[0] + at[1] * at[1] + at[2] * at[2]) - 19.0f;
    const Eight x = 1.0f + CORNER_X * at[0], y = 1.0f + CORNER_Y * at[1], z = 1.0f + CORNER_Z * at[2], all = x * y * z;
    Looked looked;
    constexpr float PART = 1.0f / 64.0f;
    add_nodes(nodes, PART * all * radial, PART * (CORNER_X * y * z * radial + all * (18.0f * at[0])),
              PART * (CORNER_Y * x * z * radial + all * (18.0f * at[1])), PART * (CORNER_Z * x * y * radial + all * (18.0f * at[2])), 0, 1, 2,
              looked);
    add_edges(nodes + 8, at, 0, 1, 2, looked);
    add_edges(nodes + 16, at, 1, 2, 0, looked);
    add_edges(nodes + 24, at, 2, 0, 1, looked);
    float sums[8];
    sum_each({looked.distance, looked.share, looked.slope[0], looked.slope[1], looked.slope[2], Eight{}, Eight{}, Eight{}}, sums);
    distance = sums[0];
    share = sums[1];
    float slope[3], square = 0.0f;
    for (int axis = 0; axis < 3; ++axis) {
        slope[axis] = sums[2 + axis] * map.per_cell[axis];
        square += slope[axis] * slope[axis];
    }
    const float scale = 1.0f / (__builtin_sqrtf(square) + 1e-12f);
    for (int axis = 0; axis < 3; ++axis)
        normal[axis] = scale * (map.turn[3 * axis] * slope[0] + map.turn[3 * axis + 1] * slope[1] + map.turn[3 * axis + 2] * slope[2]);
}

}  // namespace
}  // namespace ISA
