// A solid and a graph as plain data, for the paths.
#pragma once

#include <cstdint>

namespace surfsup {

enum class Kind : int32_t { sphere, box, cylinder, cone, torus, bowl, funnel, boxes, leaf, transformed, join, meet, difference };

// One solid in a list in which every part stands before what it is part of.
struct Node {
    Kind kind;
    int32_t numbers, count;      // where its numbers begin, and how many
    int32_t parts, part_count;   // where the places of its parts begin, and how many; of a leaf its own number
};

// What a leaf of the list tells of some points: distance, and where it is wanted the normal along each axis; a row each, with
// `room` for so many floats.
struct LeafLook {
    float* rows;
    int64_t room;
    bool with_normal;
};

struct Tree {
    const Node* nodes;
    const float* numbers;
    const int32_t* parts;
    int32_t root;
    const LeafLook* looks;       // at each leaf from these points, in its own frame
};

}  // namespace surfsup
