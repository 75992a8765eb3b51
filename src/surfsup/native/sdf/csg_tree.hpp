// A solid as a tree of constructive solid geometry (CSG), as plain data for the functions of an instruction set.
#pragma once

#include <cstdint>

namespace surfsup {

// `sampled` is a shape without a closed form, evaluated before the tree.
enum class Kind : int32_t {
    sphere,
    box,
    cylinder,
    cone,
    torus,
    bowl,
    funnel,
    boxes,
    sampled,
    transformed,
    offset,
    set_union,
    intersection,
    difference,
    complement,
    edged_intersection
};

// A node in a list where every part precedes the node it belongs to.
struct CsgNode {
    Kind kind;
    int32_t parameters, parameter_count;  // first index in CsgTree::parameters, and number
    int32_t parts, part_count;            // first index in CsgTree::parts, and number; for `sampled` the index of its samples
};

// Signed distances of a shape and, if `with_normal`, its normals at the points of a query: four rows (distance, x, y, z),
// `stride` floats apart.
struct Samples {
    float* rows;
    int64_t stride;
    bool with_normal;
};

struct CsgTree {
    const CsgNode* nodes;
    const float* parameters;
    const int32_t* parts;  // indices of nodes
    int32_t root;
    const Samples* samples;  // of each sampled shape at the points of this query, in the frame of the shape
};

}  // namespace surfsup
