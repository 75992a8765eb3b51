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

// Neighbors as torch keeps them: the edges of particle i are starts[i] up to starts[i + 1], four kernels an edge.
// With every edge there is its reverse, whose kernels differ in the sign of all but the first.
struct Sparse {
    int32_t count;
    const int64_t *starts, *senders;
    const float* kernels;
};

// Of a particle, and of these the first that its neighbors are told of; both multiples of 16.
struct Channels {
    int width, messages;
};

}  // namespace surfsup
