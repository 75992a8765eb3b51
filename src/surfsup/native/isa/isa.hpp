// The functions that are compiled once for every instruction set and chosen at run time.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "learned/convolution_data.hpp"
#include "learned/message_passing_data.hpp"
#include "sdf/csg_tree.hpp"
#include "sdf/neural_field.hpp"
#include "sph/frame.hpp"
#include "sph/impulses.hpp"

namespace surfsup {

class Arena;
void* take(Arena& arena, int64_t bytes);  // nullptr where memory ran out

// Sums over neighbors, in sph/.
struct SphKernels {
    int rows;  // particles in a block

    // Neighbors of sorted particles, kept in the first arena. Returns the number of pairs, -1 where memory ran out. `searching`
    // and `search` are the thread's own from call to call within a frame.
    int64_t (*find_neighbors)(const Frame&, int32_t begin, int32_t end, Arena&, Arena& searching, void* search);
    // The indices of sorted particles within the kernel support of sorted particle i, in any order. Returns how many, -1 where
    // memory ran out. `indices` points to them until the next call.
    int64_t (*find_within)(const Frame&, int32_t i, Arena&, void* search, const int32_t*& indices);
    int64_t search_bytes;  // of `search`, which must be zero at the start of a frame

    // A substep of DFSPH: densities and pressures of particles begin to end, then the velocities and positions they cause.
    void (*compute_pressures)(const Frame&, int substep, int32_t begin, int32_t end);
    void (*apply_pressures)(const Frame&, int substep, int32_t begin, int32_t end);
    // Before these, for liquids: densities, friction and adhesion; surface tension; the matrix of viscosity and its product
    // with the vectors in the rows, whose scalar product with them is returned.
    void (*measure_liquid)(const Frame&, int substep, int32_t begin, int32_t end);
    void (*find_surface_normals)(const Frame&, int32_t begin, int32_t end);
    void (*apply_tension)(const Frame&, int32_t begin, int32_t end);
    void (*prepare_viscosity)(const Frame&, int32_t begin, int32_t end);
    double (*multiply_viscosity)(const Frame&, int32_t begin, int32_t end);
    void (*sum_liquid_impulses)(const Frame&, const ImpulseSums&, int32_t begin, int32_t end, double* rows);
    // Adds the impulses of these pressures on solids and walls to rows like those of the sums.
    void (*sum_impulses)(const Frame&, const ImpulseSums&, int32_t begin, int32_t end, double* rows);
};

// Signed distances, in sdf/.
struct SdfKernels {
    // Signed distance of points begin to end and, unless null, their unit normal.
    void (*evaluate_tree)(const CsgTree&, const float* points, int32_t begin, int32_t end, float* distance, float* normal);
    // Samples of a neural field at points (count, 3) in its own frame. `indices` has room for `count`, `scratch` for
    // field_scratch_size() floats.
    void (*sample_field)(const NeuralField&, const float* points, int32_t count, const Samples&, int32_t* indices,
                         float* scratch);
    int64_t (*field_scratch_size)(const NeuralField&);
};

// Networks, in learned/.
struct LearnedKernels {
    int rows;  // particles in a block
    // Neighbor convolution and its gradients, see learned/convolution.hpp.
    void (*convolve)(const NeighborGraph&, int width, const float* values, const float* weights, float* out, int32_t begin,
                     int32_t end, float* scratch);
    void (*convolve_values_gradient)(const NeighborGraph&, int width, const float* gradient, const float* weights,
                                     float* values_gradient, int32_t begin, int32_t end, float* scratch);
    void (*convolve_weights_gradient)(const NeighborGraph&, int width, const float* values, const float* gradient,
                                      float* weights_gradient, int32_t begin, int32_t end, float* scratch);
    // Perceptrons of a message-passing network, see learned/message_passing_data.hpp.
    MessagePassingKernels float32;
};

struct Isa {
    const char* name;
    bool (*supported)();
    const SphKernels* sph;
    const SdfKernels* sdf;
    const LearnedKernels* learned;
    // Perceptrons with dot products of bfloat16; null where this processor has none with these instructions.
    const MessagePassingKernels* (*bfloat16)();
};

extern const Isa avx512, avx2, plain;

// With sixteen lanes; the sums over neighbors of `avx512` have eight.
extern const SdfKernels avx512_sdf;
extern const LearnedKernels avx512_learned;

// Null where the processor or the compiler lacks AVX-512 BF16.
const MessagePassingKernels* avx512_bf16();
inline const MessagePassingKernels* no_bfloat16() { return nullptr; }

// The instruction sets that this processor supports, the fastest first.
std::vector<const Isa*> instruction_sets();
// Throws std::invalid_argument where the processor does not support it.
const Isa& isa_of(const std::string& name);

}  // namespace surfsup
