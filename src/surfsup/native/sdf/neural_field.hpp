// The signed distance of a neural surface, as plain data for the functions of an instruction set.
#pragma once

#include "sdf/grid.hpp"

namespace surfsup {

// The argument of the layer's activation is the sum of `hidden` (width, width) times the previous activations, `input` (width,
// inputs) times the inputs, and `bias` (width). Either matrix may be null.
struct NeuralLayer {
    const float *hidden, *input, *bias;
};

// A network whose activations are sines of `frequency` times the argument or, if that is zero, rectified linear units. Inputs
// are a position and the sines and cosines of `octaves` multiples of it.
struct NeuralField {
    const NeuralLayer* layers;
    int layer_count, width, octaves;
    float frequency;
    const float* last;  // (width) weights of the output
    float last_bias;
    SdfGrid<float> grid;  // distances far from the surface
    float network_range;  // distance on the grid below which the network is evaluated
};

}  // namespace surfsup
