// The network with its weights, and the memory of its steps.
#pragma once

#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "runtime/aligned.hpp"
#include "runtime/arena.hpp"
#include "sph/cell_list.hpp"
#include "sph/frame.hpp"

namespace surfsup {

// A matrix as torch keeps it: a row an output.
struct Matrix {
    const float* values;
    int64_t outputs, inputs;
};

struct Layer {
    Matrix mix, own, out;
};

// The fluid and what is around it; all but the three vectors are (count, 3), `distance` is (count).
struct Fluid {
    int32_t count;
    const float *positions, *velocities, *ahead, *distance, *normal;
    const float *gravity, *lower, *upper;
    MapView map;
};

// What the network is told of each particle, as features.py has it: (count, ACTIONS), (count, SURROUNDINGS), and (count, 3),
// the last of them where the last step of the sweeps begins.
struct Told {
    float *acts, *lie, *faster, *farther, *slope, *places;
};

class Network {
public:
    // The weights are read anew in every step, so they must stay where they are, and may change in between.
    // Throws std::invalid_argument where sizes do not fit.
    Network(const Constants& constants, const SolidDensity& solids, Matrix encoder, Matrix factor_in,
            const float* factor_in_bias, Matrix factor_out, const float* factor_out_bias, const std::vector<Layer>& layers,
            Matrix decode_in, Matrix decode_out);

    // One frame by `isa` on up to `threads` threads: `positions` and `velocities` (count, 3). Returns the number of edges;
    // with more than `most_edges` it stops there, and where a place ahead is not finite it returns -1. Throws std::bad_alloc.
    int64_t step(const Fluid& fluid, float* positions, float* velocities, const Isa& isa, int threads, int64_t most_edges);

    const Constants& constants() const { return constants_; }

    // What it would be told, likewise.
    int64_t observe(const Fluid& fluid, const Told& told, const Isa& isa, int threads, int64_t most_edges);

private:
    int64_t look(const Fluid& fluid, const Isa& isa, int threads, int64_t most_edges, Frame& frame);
    void read_weights();

    Constants constants_;
    SolidDensity solids_;
    Matrix given_encoder_, given_factor_in_, given_factor_out_, given_decode_in_, given_decode_out_;
    const float *given_factor_in_bias_, *given_factor_out_bias_;
    std::vector<Layer> given_layers_;
    int width_ = 0, messages_ = 0, layers_ = 0, factors_width_ = 0;
    AlignedFloats encoder_, factor_in_, factor_in_bias_, factor_out_, factor_out_bias_, mix_, out_,
        decode_in_, decode_out_;

    // Kept from step to step; a second caller waits.
    std::mutex stepping_;
    CellList cells_;
    AlignedFloats halfway_, x_, y_, z_, motion_, pushes_, acts_, lie_, factors_, hidden_[2], told_[2];
    std::vector<Edges> edges_;
    std::vector<Sweep> sweeps_;
    std::vector<Arena> arenas_, searching_;
    std::vector<std::vector<char>> searches_;
    std::vector<AlignedFloats> scratch_;
};

// The paths that this processor can go, the fastest first.
std::vector<const Isa*> instruction_sets();

}  // namespace surfsup
