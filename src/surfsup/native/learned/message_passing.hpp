// Perceptrons on rows and on the edges of a graph, with their gradients; see learned/message_passing/native_layers.py.
#pragma once

#include <string>
#include <vector>

#include "isa/isa.hpp"

namespace surfsup {

enum class Precision { FLOAT32, BFLOAT16 };

// Weights as torch stores them, one row per output.
struct PerceptronWeights {
    int depth, width;
    const float *first, *first_bias, *hidden, *hidden_bias, *output, *output_bias, *scale, *shift;  // first_bias may be null
    float epsilon;
};

// Gradients of the same, written.
struct PerceptronWeightsGradient {
    float *first, *first_bias, *hidden, *hidden_bias, *output, *output_bias, *scale, *shift;  // first_bias may be null
};

// Whether this processor multiplies matrices of bfloat16 with these instructions.
bool has_bfloat16(const Isa& isa);

// The arrays are those of RowPass and EdgePass; their perceptrons are made from the weights. Results do not depend on the
// number of threads. Throw std::invalid_argument where the instruction set lacks bfloat16.
void rows_forward(const Isa& isa, Precision first, Precision precision, RowPass pass, const PerceptronWeights& weights,
                  int32_t count, int threads);
void rows_backward(const Isa& isa, Precision first, Precision precision, RowPass pass, const PerceptronWeights& weights,
                   const PerceptronWeightsGradient& gradient, int32_t count, int threads);
void edges_forward(const Isa& isa, Precision precision, EdgePass pass, const PerceptronWeights& weights, int32_t count,
                   int threads);
void edges_backward(const Isa& isa, Precision precision, EdgePass pass, const PerceptronWeights& weights,
                    const PerceptronWeightsGradient& gradient, int32_t count, int threads);

}  // namespace surfsup
