// Signed distances and networks with this translation unit's instruction set.
#pragma once

#include "isa/isa.hpp"
#include "learned/convolution_isa.hpp"
#include "learned/message_passing_isa.hpp"
#include "sdf/csg_tree_isa.hpp"
#include "sdf/neural_field_isa.hpp"

namespace ISA {
namespace {

constexpr surfsup::SdfKernels SDF = {evaluate_tree, sample_field, field_scratch_size};
constexpr surfsup::LearnedKernels LEARNED = {ROWS, convolve, convolve_values_gradient, convolve_weights_gradient,
                                             message_passing_kernels<Float32>()};

}  // namespace
}  // namespace ISA
