// The DFSPH solver on CPUs: the substeps of a frame and the memory that they reuse.
#pragma once

#include <cstdint>
#include <mutex>
#include <vector>

#include "isa/isa.hpp"
#include "runtime/aligned.hpp"
#include "runtime/arena.hpp"
#include "sph/cell_list.hpp"
#include "sph/impulses.hpp"
#include "sph/liquid_solver.hpp"
#include "sph/moving_solids.hpp"
#include "sph/parameters.hpp"

namespace surfsup {

// Particles and their environment. All arrays but the three vectors are (count, 3), `solid_distance` is (count).
struct Fluid {
    int32_t count;
    const float *positions, *velocities, *predicted_positions, *solid_distance, *solid_normal;
    const float *gravity, *lower, *upper;
    BoundaryMapView boundary_map;
    const MovingSolids* moving;      // nullptr where nothing moves
    const ImpulseSums* impulses;     // nullptr where they are not requested
    const LiquidParameters* liquid;  // nullptr for the solver's own water, an array of those of a mixture
    const int32_t* liquid_of;        // of each particle in a mixture: the number of its liquid; otherwise nullptr
    const float* masses;             // (count) in a mixture, otherwise nullptr
};

class Solver {
public:
    // Throws std::invalid_argument if a parameter is out of range.
    explicit Solver(SolverParameters parameters);

    // Advances by one frame without energy limit and collision handling. Writes positions and velocities (count, 3) and, where
    // its pointers are set, the record of the last substep. Returns the number of neighbor pairs; beyond `max_pairs` it stops
    // early. Returns -1 if a position is not finite. Throws std::bad_alloc. With moving solids and liquids there is no record.
    int64_t advance(const Fluid& fluid, float* positions, float* velocities, const SubstepRecord& record, const Isa& isa,
                    int threads, int64_t max_pairs);

    const SolverParameters& parameters() const { return parameters_; }

    // Work of moving solids and walls, of surface tension and adhesion on the particles in the last frame, mean J/kg.
    double outer_work() const { return solid_work_ + liquid_.work(); }

private:
    bool prepare(const Fluid& fluid, Frame& frame);
    void sort_mixture(const Fluid& fluid, const int32_t* order, Frame& frame);
    int64_t find_neighbors(const Frame& frame, const Isa& isa, int threads, int64_t max_pairs);
    void place_moving(const MovingSolids& moving, int substep, MovingFrame& placed);
    void add_solid_work(int32_t count, double mass);
    void add_impulses(const Frame& frame, const Isa& isa, int threads, const ImpulseSums& sums);

    SolverParameters parameters_, without_viscosity_;
    // Reused from frame to frame; a second caller waits.
    std::mutex stepping_;
    CellList cells_;
    AlignedFloats midpoints_, x_, y_, z_, motion_, pressure_;
    AlignedFloats solid_rate_, masses_;
    std::vector<int32_t> liquid_of_;
    std::vector<MovingBoundary> moving_boundaries_;
    RigidStep moving_walls_{};
    double solid_work_ = 0;
    LiquidSolver liquid_;
    std::vector<double> portion_impulses_;
    std::vector<Neighbors> neighbors_;
    std::vector<ParticleWork> work_;
    std::vector<Arena> arenas_, searching_;
    std::vector<std::vector<char>> searches_;
};

}  // namespace surfsup
