// A solid that a network knows, and a lattice of distances for all who are far from it, as plain data for the paths.
#pragma once

#include <cstdint>

namespace surfsup {

// Distances at the nodes of a grid, as lattice.py keeps them: four floats a node, z fastest. No table, no lattice.
struct Lattice {
    const float* table;
    float lower[3], cell;
    int32_t nodes[3];

    float upper(int axis) const { return lower[axis] + cell * static_cast<float>(nodes[axis] - 1); }
};

// The argument of a layer is `hidden` (width, width) times the layer before, `entering` (width, features) times what is
// told of the place, and `bias` (width); either matrix may be missing.
struct FieldLayer {
    const float *hidden, *entering, *bias;
};

// Layers of sines of `frequency` times their argument, or, where that is zero, of rectified linear units; a place, and
// sines and cosines of so many octaves of it, come in.
struct Field {
    const FieldLayer* layers;
    int layer_count, width, octaves;
    float frequency;
    const float* last;  // (width)
    float last_bias;
    Lattice lattice;
    float near;  // distance by the lattice up to which the network is asked

    int features() const { return 3 + 6 * octaves; }
};

}  // namespace surfsup
