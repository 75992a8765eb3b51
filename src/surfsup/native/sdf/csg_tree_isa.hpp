// Signed distances of CSG trees, compiled once for every instruction set. Gradients by forward automatic differentiation.
#pragma once

#include "isa/lanes.hpp"
#include "sdf/csg_tree.hpp"

namespace ISA {
namespace {

using surfsup::CsgNode;
using surfsup::CsgTree;
using surfsup::Kind;
using surfsup::Samples;

// A value and its gradient.
struct Dual {
    Floats value, x, y, z;
};

inline Dual constant(float value) { return {splat(value), Floats{}, Floats{}, Floats{}}; }
inline Dual operator+(const Dual& a, const Dual& b) { return {a.value + b.value, a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Dual operator-(const Dual& a, const Dual& b) { return {a.value - b.value, a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Dual operator+(const Dual& a, float b) { return {a.value + b, a.x, a.y, a.z}; }
inline Dual operator-(const Dual& a, float b) { return {a.value - b, a.x, a.y, a.z}; }
inline Dual operator*(const Dual& a, float b) { return {a.value * b, a.x * b, a.y * b, a.z * b}; }
inline Dual operator-(const Dual& a) { return {-a.value, -a.x, -a.y, -a.z}; }

inline Dual where(Ints condition, const Dual& yes, const Dual& no) {
    return {condition ? yes.value : no.value, condition ? yes.x : no.x, condition ? yes.y : no.y, condition ? yes.z : no.z};
}

// If both values are equal, the gradient is the mean of both gradients, as in torch.
inline Dual larger(const Dual& a, const Dual& b) {
    const Dual mean = {a.value, 0.5f * (a.x + b.x), 0.5f * (a.y + b.y), 0.5f * (a.z + b.z)};
    return where(a.value > b.value, a, where(a.value == b.value, mean, b));
}

inline Dual smaller(const Dual& a, const Dual& b) { return -larger(-a, -b); }

inline Dual unit_gradient(const Dual& a) {
    const Floats inverse = 1.0f / at_least(square_root(a.x * a.x + a.y * a.y + a.z * a.z), 1e-12f);
    return {a.value, a.x * inverse, a.y * inverse, a.z * inverse};
}

// The distance to the edge where both solids meet, see surfsup/sdf/edges.py; elsewhere the larger one.
inline Dual beside_edge(const Dual& first, const Dual& second, Floats bound) {
    const Dual a = unit_gradient(first), b = unit_gradient(second);
    const Floats cosine = a.x * b.x + a.y * b.y + a.z * b.z, sine_squared = 1.0f - cosine * cosine;
    const Ints at_edge = (a.value > cosine * b.value) & (b.value > cosine * a.value) & (a.value > 0.0f) & (b.value > 0.0f) &
                         (sine_squared > 1e-3f);
    const Floats inverse = 1.0f / at_least(sine_squared, 1e-3f);
    const Floats along_a = (a.value - cosine * b.value) * inverse, along_b = (b.value - cosine * a.value) * inverse;
    const Floats distance = square_root(at_least(along_a * a.value + along_b * b.value, 0.0f));
    const Floats scale = 1.0f / at_least(distance, 1e-12f), most = 2.0f * bound;
    const Dual edge = {distance < most ? distance : most, (along_a * a.x + along_b * b.x) * scale,
                       (along_a * a.y + along_b * b.y) * scale, (along_a * a.z + along_b * b.z) * scale};
    return where(at_edge, edge, larger(first, second));
}

inline Dual clamp_min(const Dual& a, float min) { return where(a.value < min, constant(min), a); }
inline Dual clamp_max(const Dual& a, float max) { return where(a.value > max, constant(max), a); }

inline Dual absolute(const Dual& a) {
    const Dual zero = {Floats{}, Floats{}, Floats{}, Floats{}};
    return where(a.value < 0.0f, -a, where(a.value > 0.0f, a, zero));
}

// The gradient is zero at zero.
inline Dual length(const Dual& a, const Dual& b, const Dual& c) {
    const Floats squared = a.value * a.value + b.value * b.value + c.value * c.value;
    const Floats root = square_root(squared);
    const Floats inverse = squared > 0.0f ? 1.0f / root : Floats{};
    return {root, (a.value * a.x + b.value * b.x + c.value * c.x) * inverse,
            (a.value * a.y + b.value * b.y + c.value * c.y) * inverse,
            (a.value * a.z + b.value * b.z + c.value * c.z) * inverse};
}

inline Dual length(const Dual& a, const Dual& b) { return length(a, b, constant(0.0f)); }

struct Points {
    Floats x, y, z;
    int32_t first;  // index of the first lane among the points of the query
};

inline Dual x_of(const Points& p) { return {p.x, splat(1.0f), Floats{}, Floats{}}; }
inline Dual y_of(const Points& p) { return {p.y, Floats{}, splat(1.0f), Floats{}}; }
inline Dual z_of(const Points& p) { return {p.z, Floats{}, Floats{}, splat(1.0f)}; }
inline Dual axis_distance(const Points& p) { return length(x_of(p), y_of(p)); }

inline Dual box(const Points& p, const float* side) {
    const Dual x = absolute(x_of(p)) - side[0] / 2, y = absolute(y_of(p)) - side[1] / 2, z = absolute(z_of(p)) - side[2] / 2;
    return length(clamp_min(x, 0.0f), clamp_min(y, 0.0f), clamp_min(z, 0.0f)) + clamp_max(larger(larger(x, y), z), 0.0f);
}

inline Dual cylinder(const Points& p, float radius, float height) {
    const Dual radial = axis_distance(p) - radius, axial = absolute(z_of(p)) - height / 2;
    return length(clamp_min(radial, 0.0f), clamp_min(axial, 0.0f)) + clamp_max(larger(radial, axial), 0.0f);
}

inline Dual cone(const Points& p, float height, float bottom, float top) {
    const float half = height / 2, slope = top - bottom, slant = __builtin_sqrtf(slope * slope + height * height);
    const float side_radial = slope / slant, side_axial = height / slant;
    const Dual radial = axis_distance(p), axial = z_of(p);
    const Dual beyond_bottom = radial - bottom, above_bottom = axial + half;
    const Dual beyond_top = radial - top, above_top = axial - half;
    const Dual to_side = beyond_bottom * side_axial - above_bottom * side_radial;
    const Dual to_edges = larger(to_side, absolute(axial) - half);
    const Ints next_to_bottom =
        (beyond_bottom.value > 0.0f) & (beyond_bottom.value * side_radial + above_bottom.value * side_axial < 0.0f);
    const Ints next_to_top = (beyond_top.value > 0.0f) & (beyond_top.value * side_radial + above_top.value * side_axial > 0.0f);
    return where(next_to_bottom, length(beyond_bottom, above_bottom),
                 where(next_to_top, length(beyond_top, above_top), to_edges));
}

inline Dual torus(const Points& p, float major, float minor) { return length(axis_distance(p) - major, z_of(p)) - minor; }

inline Dual bowl(const Points& p, float capture, float filter, float wall) {
    const float middle = capture + wall / 2, outer = capture + wall;
    const float below = -__builtin_sqrtf(outer * outer - filter * filter);
    const float above = -__builtin_sqrtf(capture * capture - filter * filter);
    const Dual radial = axis_distance(p), axial = z_of(p), center = length(x_of(p), y_of(p), z_of(p));
    const Dual to_rim = length(radial - middle, axial) - wall / 2;
    const Dual to_closed = where(axial.value > 0.0f, to_rim, absolute(center - middle) - wall / 2);
    const Floats nearest = at_most(at_least(center.value, capture), outer);
    const Floats radial_of_nearest = radial.value * nearest / at_least(center.value, 1.17549435e-38f);
    const Ints removed = (axial.value <= 0.0f) & (radial_of_nearest < filter);
    const Dual beside = axial - clamp_max(clamp_min(axial, below), above);
    const Dual to_hole = length(constant(filter) - radial, beside);
    const Dual beside_hole = filter > 0.0f ? constant(filter) - radial : constant(-wall);
    return where(removed, smaller(to_hole, to_rim), larger(to_closed, beside_hole));
}

// Distance from the line segment between two points of the (radial, axial) half plane.
inline Dual segment_distance(const Dual& radial, const Dual& axial, float r0, float z0, float r1, float z1) {
    const float r = r1 - r0, z = z1 - z0, squared = r * r + z * z;
    const Dual fraction = clamp_max(clamp_min((radial - r0) * (r / squared) + (axial - z0) * (z / squared), 0.0f), 1.0f);
    return length(radial - r0 - fraction * r, axial - z0 - fraction * z);
}

inline Dual funnel(const Points& p, float capture, float filter, float height, float spout, float wall) {
    const Dual radial = axis_distance(p), axial = z_of(p);
    const float rim = capture + wall / 2, neck = filter + wall / 2;
    const Dual cone = segment_distance(radial, axial, rim, 0.0f, neck, -height);
    const Dual tube = segment_distance(radial, axial, neck, -height, neck, -height - spout);
    return smaller(cone, tube) - wall / 2;
}

// Points in the frame of a part that was scaled, rotated (row by row) and moved; and a distance back from that frame.
inline Points to_frame(const Points& p, const float* rotation, const float* move, float scale) {
    const Floats x = p.x - move[0], y = p.y - move[1], z = p.z - move[2];
    const float inverse = 1.0f / scale;
    return {(x * rotation[0] + y * rotation[3] + z * rotation[6]) * inverse,
            (x * rotation[1] + y * rotation[4] + z * rotation[7]) * inverse,
            (x * rotation[2] + y * rotation[5] + z * rotation[8]) * inverse, p.first};
}

inline Dual from_frame(const Dual& d, const float* rotation, float scale) {
    return {d.value * scale, rotation[0] * d.x + rotation[1] * d.y + rotation[2] * d.z,
            rotation[3] * d.x + rotation[4] * d.y + rotation[5] * d.z,
            rotation[6] * d.x + rotation[7] * d.y + rotation[8] * d.z};
}

Dual signed_distance(const CsgTree& tree, int32_t index, const Points& p) {
    const CsgNode& node = tree.nodes[index];
    const float* n = tree.parameters + node.parameters;
    const int32_t* parts = tree.parts + node.parts;
    switch (node.kind) {
        case Kind::sphere: return length(x_of(p), y_of(p), z_of(p)) - n[0];
        case Kind::box: return box(p, n);
        case Kind::cylinder: return cylinder(p, n[0], n[1]);
        case Kind::cone: return cone(p, n[0], n[1], n[2]);
        case Kind::torus: return torus(p, n[0], n[1]);
        case Kind::bowl: return bowl(p, n[0], n[1], n[2]);
        case Kind::funnel: return funnel(p, n[0], n[1], n[2], n[3], n[4]);
        case Kind::sampled: {
            const Samples& samples = tree.samples[node.parts];
            const float* row = samples.rows + p.first;
            if (!samples.with_normal) return {load(row), Floats{}, Floats{}, Floats{}};
            const int64_t stride = samples.stride;
            return {load(row), load(row + stride), load(row + 2 * stride), load(row + 3 * stride)};
        }
        case Kind::transformed:  // rotation, translation, scale
            return from_frame(signed_distance(tree, parts[0], to_frame(p, n, n + 9, n[12])), n, n[12]);
        case Kind::offset: return signed_distance(tree, parts[0], p) - n[0];
        case Kind::boxes: {  // size, rotation, center of each; the first of equally near ones
            Dual nearest = constant(__builtin_inff());
            for (int32_t k = 0; k < node.parameter_count; k += 15) {
                const Dual distance = from_frame(box(to_frame(p, n + k + 3, n + k + 12, 1.0f), n + k), n + k + 3, 1.0f);
                nearest = where(distance.value < nearest.value, distance, nearest);
            }
            return nearest;
        }
        case Kind::set_union: {
            Dual nearest = signed_distance(tree, parts[0], p);
            for (int32_t k = 1; k < node.part_count; ++k) nearest = smaller(nearest, signed_distance(tree, parts[k], p));
            return nearest;
        }
        case Kind::intersection: {
            Dual farthest = signed_distance(tree, parts[0], p);
            for (int32_t k = 1; k < node.part_count; ++k) farthest = larger(farthest, signed_distance(tree, parts[k], p));
            return farthest;
        }
        case Kind::edged_intersection: {
            Dual farthest = signed_distance(tree, parts[0], p);
            Floats bound = farthest.value;
            for (int32_t k = 1; k < node.part_count; ++k) {
                const Dual part = signed_distance(tree, parts[k], p);
                bound = part.value > bound ? part.value : bound;
                farthest = beside_edge(farthest, part, bound);
            }
            return farthest;
        }
        case Kind::complement: return -signed_distance(tree, parts[0], p);
        case Kind::difference: return larger(signed_distance(tree, parts[0], p), -signed_distance(tree, parts[1], p));
    }
    return constant(__builtin_nanf(""));
}

void evaluate_tree(const CsgTree& tree, const float* points, int32_t begin, int32_t end, float* distance, float* normal) {
    for (int32_t first = begin; first < end; first += LANES) {
        const int count = end - first < LANES ? end - first : LANES;
        float positions[3][LANES], results[4][LANES];
        for (int lane = 0; lane < LANES; ++lane)
            for (int axis = 0; axis < 3; ++axis)
                positions[axis][lane] = points[3 * static_cast<int64_t>(first + (lane < count ? lane : 0)) + axis];
        const Points p = {load(positions[0]), load(positions[1]), load(positions[2]), first};
        const Dual result = signed_distance(tree, tree.root, p);
        const Floats squared = result.x * result.x + result.y * result.y + result.z * result.z;
        const Floats inverse = 1.0f / at_least(square_root(squared), 1e-12f);
        // Comparisons may have lost a NaN; restore it.
        const Floats nan = ((p.x == p.x) & (p.y == p.y) & (p.z == p.z)) ? Floats{} : splat(__builtin_nanf(""));
        store(results[0], result.value + nan);
        store(results[1], result.x * inverse + nan);
        store(results[2], result.y * inverse + nan);
        store(results[3], result.z * inverse + nan);
        for (int lane = 0; lane < count; ++lane) {
            const int64_t at = first + lane;
            distance[at] = results[0][lane];
            if (!normal) continue;
            for (int axis = 0; axis < 3; ++axis) normal[3 * at + axis] = results[1 + axis][lane];
        }
    }
}

}  // namespace
}  // namespace ISA
