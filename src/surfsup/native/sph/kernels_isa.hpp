// The cubic spline kernel of sph/kernels.py, compiled once for every instruction set.
#pragma once

#include "isa/lanes.hpp"

namespace ISA {
namespace {

// At displacements in units of the kernel support: W / W(0), the steepness -W' / (2 W(0)) of the kernel, the factor from the
// displacement to the kernel gradient, and the squared distance.
struct Kernels {
    Floats value, steepness, gradient_factor, squared_distance;
};

inline Kernels kernels_at(Floats x, Floats y, Floats z) {
    const Floats square = x * x + y * y + z * z, inverse = reciprocal_root(at_least(square, 1e-12f)),
                 distance = square * inverse;
    const Floats outer = at_least(1.0f - distance, 0.0f), inner = at_least(0.5f - distance, 0.0f);
    const Floats outer_square = outer * outer, inner_square = 4.0f * inner * inner;
    const Floats steepness = 3.0f * (outer_square - inner_square);
    return {2.0f * (outer_square * outer - inner_square * inner), steepness, steepness * inverse, square};
}

}  // namespace
}  // namespace ISA
