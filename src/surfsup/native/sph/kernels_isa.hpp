// The kernels of convolution.py, compiled once a isa.
#pragma once

#include "isa/lanes.hpp"

namespace ISA {
namespace {

// Of neighbors at displacements in units of the radius: the smoothing kernel, how steep it is but for its sign, by what the
// displacement is multiplied to give its slope, and the distance's square.
struct Kernels {
    Floats window, steep, along, square;
};

inline Kernels kernels_at(Floats x, Floats y, Floats z) {
    const Floats square = x * x + y * y + z * z, inverse = reciprocal_root(at_least(square, 1e-12f)), distance = square * inverse;
    const Floats whole = at_least(1.0f - distance, 0.0f), inner = at_least(0.5f - distance, 0.0f);
    const Floats of_whole = whole * whole, of_inner = 4.0f * inner * inner;
    const Floats steep = 3.0f * (of_whole - of_inner);
    return {2.0f * (of_whole * whole - of_inner * inner), steep, steep * inverse, square};
}

}  // namespace
}  // namespace ISA
