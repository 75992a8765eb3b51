// A message-passing network's perceptrons and steps as plain data, see learned/message_passing/network.py.
#pragma once

#include <cstdint>

namespace surfsup {

constexpr int ROW_TILE = 48;    // rows that go through a perceptron together: they stay in the first cache
constexpr int DEPTH_UNIT = 8;   // the depth of an input is padded to a multiple of it
constexpr int WIDTH_UNIT = 16;  // widths are multiples of it

constexpr int padded(int value, int unit) { return (value + unit - 1) / unit * unit; }

// Linear, ReLU, linear, ReLU, linear, LayerNorm. A packed matrix of `columns` outputs has its inputs in groups of as many as a
// product takes at once, one in float32 and two in bfloat16: [input / group][output][input % group]. The inputs are padded.
struct Perceptron {
    int depth, width;                                                      // of the input; of all layers
    const void *first, *hidden, *output;                                   // packed
    const void *first_transposed, *hidden_transposed, *output_transposed;  // packed, for gradients
    const float *first_bias, *hidden_bias, *output_bias, *scale, *shift;   // (width); an edge's first layer has no bias
    const float* no_bias;                                                  // zeros, as many as the widest matrix has columns
    float epsilon;
};

// What the backward pass needs of the forward pass; null where there will be none. Matrices are (rows, width).
struct Activations {
    void *hidden_1, *hidden_2, *normalized;
    float* inverse_std;  // (rows)
};

// Sums of gradients. Matrices have a row per input, unlike those of torch.
struct PerceptronGradient {
    float *first, *hidden, *output;  // (padded depth, width), twice (width, width)
    float *first_bias, *hidden_bias, *output_bias, *scale, *shift;
};

// A perceptron applied to every row of a matrix. The first layer may compute in float32, the others in bfloat16.
struct RowPass {
    Perceptron perceptron;
    Activations kept;
    const float* rows;         // (count, depth)
    bool out_float32;          // whether `out` and its gradient are float32, otherwise in the precision of the layers
    void* out;                 // (count, width), forward
    const void* out_gradient;  // (count, width), backward
    float* rows_gradient;      // (count, depth) or null, backward
};

// A perceptron applied to every edge, whose messages are summed at the receivers. The edges of receiver i are starts[i] to
// starts[i + 1]. Arrays without a type are in the precision of the edges.
struct EdgePass {
    Perceptron perceptron;
    Activations kept;
    const int64_t *starts, *senders;
    const void* endpoints;           // (count, 2, width), what a node adds to the first layer as sender and as receiver
    const void* edges;               // (edges, width)
    float* received;                 // (count, width), forward
    void* new_edges;                 // (edges, width) or null, forward
    const float* received_gradient;  // (count, width), backward
    const void* new_edges_gradient;  // (edges, width) or null
    void* edges_gradient;            // (edges, width)
    void* first_gradient;            // (edges, width), of the first layer before its ReLU
    const int32_t* by_sender;        // (edges), the edges with sender i are entries starts[i] to starts[i + 1]
    void* endpoints_gradient;        // (count, 2, width)
};

// The kernels of one precision. `scratch` has room for scratch_size() floats.
struct MessagePassingKernels {
    void (*rows_forward)(const RowPass&, int32_t begin, int32_t end, float* scratch);
    void (*rows_backward)(const RowPass&, const PerceptronGradient&, int32_t begin, int32_t end, float* scratch);
    // The same with the first layer in float32.
    void (*features_forward)(const RowPass&, int32_t begin, int32_t end, float* scratch);
    void (*features_backward)(const RowPass&, const PerceptronGradient&, int32_t begin, int32_t end, float* scratch);
    // Of receivers begin to end.
    void (*edges_forward)(const EdgePass&, int32_t begin, int32_t end, float* scratch);
    void (*edges_backward)(const EdgePass&, const PerceptronGradient&, int32_t begin, int32_t end, float* scratch);
    // Sums first_gradient at both ends of the edges.
    void (*endpoints_backward)(const EdgePass&, int32_t begin, int32_t end);
};

constexpr int64_t scratch_size(int depth, int width) {
    const int64_t widest = depth > width ? padded(depth, WIDTH_UNIT) : width;
    return ROW_TILE * (9 * widest + 1);
}

}  // namespace surfsup
