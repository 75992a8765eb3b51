// Distances of solids, compiled once a isa. A value carries its gradient along (automatic differentiation, forward).
#pragma once

#include "isa/lanes.hpp"
#include "sdf/tree.hpp"

namespace ISA {
namespace {

using surfsup::Kind;
using surfsup::Node;
using surfsup::Tree;

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

inline Dual where(Ints which, const Dual& yes, const Dual& no) {
    return {which ? yes.value : no.value, which ? yes.x : no.x, which ? yes.y : no.y, which ? yes.z : no.z};
}

// Where both are equal the gradient is the mean of both, as in torch.
inline Dual larger(const Dual& a, const Dual& b) {
    const Dual mean = {a.value, 0.5f * (a.x + b.x), 0.5f * (a.y + b.y), 0.5f * (a.z + b.z)};
    return where(a.value > b.value, a, where(a.value == b.value, mean, b));
}

inline Dual smaller(const Dual& a, const Dual& b) { return -larger(-a, -b); }

inline Dual not_below(const Dual& a, float least) { return where(a.value < least, constant(least), a); }
inline Dual not_above(const Dual& a, float most) { return where(a.value > most, constant(most), a); }

inline Dual size(const Dual& a) {
    const Dual zero = {Floats{}, Floats{}, Floats{}, Floats{}};
    return where(a.value < 0.0f, -a, where(a.value > 0.0f, a, zero));
}

// At zero the gradient is zero.
inline Dual length(const Dual& a, const Dual& b, const Dual& c) {
    const Floats squared = a.value * a.value + b.value * b.value + c.value * c.value;
    const Floats root = square_root(squared);
    const Floats inverse = squared > 0.0f ? 1.0f / root : Floats{};
    return {root, (a.value * a.x + b.value * b.x + c.value * c.x) * inverse,
            (a.value * a.y + b.value * b.y + c.value * c.y) * inverse,
            (a.value * a.z + b.value * b.z + c.value * c.z) * inverse};
}

inline Dual length(const Dual& a, const Dual& b) { return length(a, b, constant(0.0f)); }

struct Point {
    Floats x, y, z;
    int32_t first;  // of so many lanes, among all that are looked at
};

inline Dual along_x(const Point& p) { return {p.x, splat(1.0f), Floats{}, Floats{}}; }
inline Dual along_y(const Point& p) { return {p.y, Floats{}, splat(1.0f), Floats{}}; }
inline Dual along_z(const Point& p) { return {p.z, Floats{}, Floats{}, splat(1.0f)}; }
inline Dual from_axis(const Point& p) { return length(along_x(p), along_y(p)); }

inline Dual box(const Point& p, const float* side) {
    const Dual x = size(along_x(p)) - side[0] / 2, y = size(along_y(p)) - side[1] / 2, z = size(along_z(p)) - side[2] / 2;
    return length(not_below(x, 0.0f), not_below(y, 0.0f), not_below(z, 0.0f)) + not_above(larger(larger(x, y), z), 0.0f);
}

inline Dual cylinder(const Point& p, float radius, float height) {
    const Dual radial = from_axis(p) - radius, axial = size(along_z(p)) - height / 2;
    return length(not_below(radial, 0.0f), not_below(axial, 0.0f)) + not_above(larger(radial, axial), 0.0f);
}

inline Dual cone(const Point& p, float height, float bottom, float top) {
    const float half = height / 2, slope = top - bottom, slant = __builtin_sqrtf(slope * slope + height * height);
    const float side_radial = slope / slant, side_axial = height / slant;
    const Dual radial = from_axis(p), axial = along_z(p);
    const Dual beyond_bottom = radial - bottom, above_bottom = axial + half;
    const Dual beyond_top = radial - top, above_top = axial - half;
    const Dual to_side = beyond_bottom * side_axial - above_bottom * side_radial;
    const Dual to_lines = larger(to_side, size(axial) - half);
    const Ints next_to_bottom =
        (beyond_bottom.value > 0.0f) & (beyond_bottom.value * side_radial + above_bottom.value * side_axial < 0.0f);
    const Ints next_to_top =
        (beyond_top.value > 0.0f) & (beyond_top.value * side_radial + above_top.value * side_axial > 0.0f);
    return where(next_to_bottom, length(beyond_bottom, above_bottom),
                 where(next_to_top, length(beyond_top, above_top), to_lines));
}

inline Dual torus(const Point& p, float major, float minor) {
    return length(from_axis(p) - major, along_z(p)) - minor;
}

inline Dual bowl(const Point& p, float capture, float filter, float wall) {
    const float middle = capture + wall / 2, outer = capture + wall;
    const float below = -__builtin_sqrtf(outer * outer - filter * filter);
    const float above = -__builtin_sqrtf(capture * capture - filter * filter);
    const Dual radial = from_axis(p), axial = along_z(p), center = length(along_x(p), along_y(p), along_z(p));
    const Dual to_rim = length(radial - middle, axial) - wall / 2;
    const Dual to_closed = where(axial.value > 0.0f, to_rim, size(center - middle) - wall / 2);
    const Floats nearest = at_most(at_least(center.value, capture), outer);
    const Floats radial_of_nearest = radial.value * nearest / at_least(center.value, 1.17549435e-38f);
    const Ints taken_away = (axial.value <= 0.0f) & (radial_of_nearest < filter);
    const Dual beside = axial - not_above(not_below(axial, below), above);
    const Dual to_hole = length(constant(filter) - radial, beside);
    const Dual beside_hole = filter > 0.0f ? constant(filter) - radial : constant(-wall);
    return where(taken_away, smaller(to_hole, to_rim), larger(to_closed, beside_hole));
}

// From the straight line between two points of the (radial, axial) half plane.
inline Dual to_segment(const Dual& radial, const Dual& axial, float r0, float z0, float r1, float z1) {
    const float r = r1 - r0, z = z1 - z0, squared = r * r + z * z;
    const Dual share = not_above(not_below((radial - r0) * (r / squared) + (axial - z0) * (z / squared), 0.0f), 1.0f);
    return length(radial - r0 - share * r, axial - z0 - share * z);
}

inline Dual funnel(const Point& p, float capture, float filter, float height, float spout, float wall) {
    const Dual radial = from_axis(p), axial = along_z(p);
    const float rim = capture + wall / 2, neck = filter + wall / 2;
    const Dual cone = to_segment(radial, axial, rim, 0.0f, neck, -height);
    const Dual tube = to_segment(radial, axial, neck, -height, neck, -height - spout);
    return smaller(cone, tube) - wall / 2;
}

// A point in the frame of what was turned by `rotation` (row by row) and moved by `move`, and a gradient back from it.
inline Point turned_back(const Point& p, const float* rotation, const float* move, float scale) {
    const Floats x = p.x - move[0], y = p.y - move[1], z = p.z - move[2];
    const float inverse = 1.0f / scale;
    return {(x * rotation[0] + y * rotation[3] + z * rotation[6]) * inverse,
            (x * rotation[1] + y * rotation[4] + z * rotation[7]) * inverse,
            (x * rotation[2] + y * rotation[5] + z * rotation[8]) * inverse, p.first};
}

inline Dual turned(const Dual& d, const float* rotation, float scale) {
    return {d.value * scale, rotation[0] * d.x + rotation[1] * d.y + rotation[2] * d.z,
            rotation[3] * d.x + rotation[4] * d.y + rotation[5] * d.z,
            rotation[6] * d.x + rotation[7] * d.y + rotation[8] * d.z};
}

Dual distance_of(const Tree& tree, int32_t place, const Point& p) {
    const Node& node = tree.nodes[place];
    const float* n = tree.numbers + node.numbers;
    const int32_t* parts = tree.parts + node.parts;
    switch (node.kind) {
        case Kind::sphere: return length(along_x(p), along_y(p), along_z(p)) - n[0];
        case Kind::box: return box(p, n);
        case Kind::cylinder: return cylinder(p, n[0], n[1]);
        case Kind::cone: return cone(p, n[0], n[1], n[2]);
        case Kind::torus: return torus(p, n[0], n[1]);
        case Kind::bowl: return bowl(p, n[0], n[1], n[2]);
        case Kind::funnel: return funnel(p, n[0], n[1], n[2], n[3], n[4]);
        case Kind::leaf: {
            const LeafLook& look = tree.looks[node.parts];
            const float* row = look.rows + p.first;
            if (!look.with_normal) return {load(row), Floats{}, Floats{}, Floats{}};
            const int64_t room = look.room;
            return {load(row), load(row + room), load(row + 2 * room), load(row + 3 * room)};
        }
        case Kind::transformed:  // rotation, translation, scale
            return turned(distance_of(tree, parts[0], turned_back(p, n, n + 9, n[12])), n, n[12]);
        case Kind::boxes: {  // size, rotation, center of each; of equally near ones the first
            Dual nearest = constant(__builtin_inff());
            for (int32_t k = 0; k < node.count; k += 15) {
                const Dual one = turned(box(turned_back(p, n + k + 3, n + k + 12, 1.0f), n + k), n + k + 3, 1.0f);
                nearest = where(one.value < nearest.value, one, nearest);
            }
            return nearest;
        }
        case Kind::join: {
            Dual nearest = distance_of(tree, parts[0], p);
            for (int32_t k = 1; k < node.part_count; ++k) nearest = smaller(nearest, distance_of(tree, parts[k], p));
            return nearest;
        }
        case Kind::meet: {
            Dual farthest = distance_of(tree, parts[0], p);
            for (int32_t k = 1; k < node.part_count; ++k) farthest = larger(farthest, distance_of(tree, parts[k], p));
            return farthest;
        }
        case Kind::difference: return larger(distance_of(tree, parts[0], p), -distance_of(tree, parts[1], p));
    }
    return constant(__builtin_nanf(""));
}

void distance(const Tree& tree, const float* points, int32_t begin, int32_t end, float* to_distance, float* to_normal) {
    for (int32_t first = begin; first < end; first += LANES) {
        const int here = end - first < LANES ? end - first : LANES;
        float places[3][LANES], told[4][LANES];
        for (int lane = 0; lane < LANES; ++lane)
            for (int axis = 0; axis < 3; ++axis)
                places[axis][lane] = points[3 * static_cast<int64_t>(first + (lane < here ? lane : 0)) + axis];
        const Point p = {load(places[0]), load(places[1]), load(places[2]), first};
        const Dual found = distance_of(tree, tree.root, p);
        const Floats squared = found.x * found.x + found.y * found.y + found.z * found.z;
        const Floats inverse = 1.0f / at_least(square_root(squared), 1e-12f);
        // A comparison may have lost what is no number; here it comes back.
        const Floats no_number = ((p.x == p.x) & (p.y == p.y) & (p.z == p.z)) ? Floats{} : splat(__builtin_nanf(""));
        store(told[0], found.value + no_number);
        store(told[1], found.x * inverse + no_number);
        store(told[2], found.y * inverse + no_number);
        store(told[3], found.z * inverse + no_number);
        for (int lane = 0; lane < here; ++lane) {
            const int64_t at = first + lane;
            to_distance[at] = told[0][lane];
            if (!to_normal) continue;
            for (int axis = 0; axis < 3; ++axis) to_normal[3 * at + axis] = told[1 + axis][lane];
        }
    }
}

}  // namespace
}  // namespace ISA
