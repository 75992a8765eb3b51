// Surface tension, adhesion and implicit viscosity of a substep: the order of their steps, and conjugate gradients.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "isa/isa.hpp"
#include "runtime/aligned.hpp"
#include "sph/impulses.hpp"
#include "sph/liquid.hpp"

namespace surfsup {

class LiquidSolver {
public:
    // Begins a frame; `frame` must outlive it. Afterwards its `liquid` is set. In a mixture the parameters are an array, and
    // `liquid_of` holds their number for each sorted particle; otherwise it is null.
    void begin(const LiquidParameters* parameters, const int32_t* liquid_of, Frame& frame, const Isa& isa, int threads);
    // Changes the velocities of the particles at the start of a substep.
    void advance(Frame& frame, int substep);
    // Adds the impulses of this substep on solids and walls.
    void add_impulses(const Frame& frame, const ImpulseSums& sums);

    // Work of surface tension, adhesion and moving solids on the particles since the frame began, mean J/kg.
    double work() const { return work_; }
    void forget_work() { work_ = 0, iterations_ = 0; }
    // Iterations of conjugate gradients since the frame began.
    int iterations() const { return iterations_; }

private:
    using Range = std::function<double(int32_t begin, int32_t end)>;
    double sum_of(const Range& part);
    void solve_viscosity(Frame& frame, int substep);
    double kinetic_energy(const Frame& frame, int substep);

    LiquidFrame liquid_{};
    double mass_ = 0;
    bool attracts_ = false;
    const Isa* isa_ = nullptr;
    int threads_ = 1;
    int32_t count_ = 0;
    AlignedFloats rows_, friction_, inverse_diagonal_, start_, change_, solution_, residual_, product_;
    std::vector<double> portions_;
    double work_ = 0;
    int iterations_ = 0;
};

}  // namespace surfsup
