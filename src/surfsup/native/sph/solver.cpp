#include "sph/solver.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <new>
#include <stdexcept>

#include "runtime/threads.hpp"

namespace surfsup {
namespace {

constexpr int WIDEST = 16;        // lanes of the widest vectors
constexpr float FAR_AWAY = 1e6f;  // meters: coordinates of the particle that pads lists of neighbors

}  // namespace

Solver::Solver(SolverParameters parameters) : parameters_(std::move(parameters)) {
    if (parameters_.substeps < 1) throw std::invalid_argument("a frame needs at least one substep");
    if (!(parameters_.kernel_support > 0)) throw std::invalid_argument("the kernel support must be above zero");
    if (parameters_.boundary.plane_fraction.size() < 2)
        throw std::invalid_argument("the table of volume fractions needs at least two entries");
    without_viscosity_ = parameters_;
    without_viscosity_.viscosity = 0.0f;
}

// Sorts the particles by cell. False where a position is not finite.
bool Solver::prepare(const Fluid& fluid, Frame& frame) {
    const auto count = static_cast<size_t>(fluid.count);
    midpoints_.resize(3 * count);
    for (size_t k = 0; k < 3 * count; ++k) midpoints_[k] = 0.5f * (fluid.positions[k] + fluid.predicted_positions[k]);
    const bool finite = cells_.sort(midpoints_.data(), fluid.count, parameters_.kernel_support);
    const int32_t* order = cells_.order();
    for (auto* sorted : {&x_, &y_, &z_}) sorted->resize(count + WIDEST);
    motion_.resize(static_cast<size_t>(MOTION_ROW) * (count + 1));
    pressure_.resize(static_cast<size_t>(PRESSURE_ROW) * (count + 1));
    for (size_t i = 0; i < count; ++i) {
        const size_t caller = static_cast<size_t>(order[i]);
        x_[i] = midpoints_[3 * caller];
        y_[i] = midpoints_[3 * caller + 1];
        z_[i] = midpoints_[3 * caller + 2];
        float* motion = &motion_[static_cast<size_t>(MOTION_ROW) * i];
        for (size_t axis = 0; axis < 3; ++axis) {
            motion[axis] = fluid.positions[3 * caller + axis];
            motion[4 + axis] = fluid.velocities[3 * caller + axis];
        }
        motion[3] = motion[7] = 0.0f;
    }
    float* padding = &motion_[static_cast<size_t>(MOTION_ROW) * count];
    std::fill_n(padding, 4, FAR_AWAY);
    std::fill_n(padding + 4, 4, 0.0f);
    float* padding_pressure = &pressure_[static_cast<size_t>(PRESSURE_ROW) * count];
    std::fill_n(padding_pressure, 3, FAR_AWAY);
    padding_pressure[3] = 0.0f;
    neighbors_.resize(count);
    work_.resize(count);

    frame.count = fluid.count;
    frame.parameters = &parameters_;
    frame.cells = cells_.cells();
    frame.order = order;
    frame.x = x_.data(), frame.y = y_.data(), frame.z = z_.data();
    frame.positions = fluid.positions, frame.velocities = fluid.velocities;
    frame.predicted_positions = fluid.predicted_positions;
    frame.solid_distance = fluid.solid_distance, frame.solid_normal = fluid.solid_normal;
    for (int axis = 0; axis < 3; ++axis) {
        frame.gravity[axis] = fluid.gravity[axis];
        frame.lower[axis] = fluid.lower[axis];
        frame.upper[axis] = fluid.upper[axis];
        const float size = fluid.upper[axis] - fluid.lower[axis];
        frame.wall_cell[axis] = size / std::max(1.0f, std::nearbyint(size / parameters_.boundary.wall_cell));
    }
    frame.boundary_map = fluid.boundary_map;
    if (fluid.masses) sort_mixture(fluid, order, frame);
    frame.neighbors = neighbors_.data();
    frame.work = work_.data();
    frame.motion = motion_.data(), frame.pressure = pressure_.data();
    return finite;
}

// The liquid and the mass of each sorted particle.
void Solver::sort_mixture(const Fluid& fluid, const int32_t* order, Frame& frame) {
    const auto count = static_cast<size_t>(fluid.count);
    masses_.resize(count);
    liquid_of_.resize(count);
    for (size_t i = 0; i < count; ++i) {
        liquid_of_[i] = fluid.liquid_of[order[i]];
        masses_[i] = fluid.masses[order[i]];
        motion_[static_cast<size_t>(MOTION_ROW) * i + 3] = 1.0f / masses_[i];
    }
    frame.masses = masses_.data();
}

int64_t Solver::find_neighbors(const Frame& frame, const Isa& isa, int threads, int64_t max_pairs) {
    for (auto* arenas : {&arenas_, &searching_}) {
        arenas->resize(std::max(arenas->size(), static_cast<size_t>(threads)));
        for (Arena& arena : *arenas) arena.reset();
    }
    searches_.assign(static_cast<size_t>(threads), std::vector<char>(static_cast<size_t>(isa.sph->search_bytes)));
    std::atomic<int64_t> pairs{0};
    std::atomic<bool> enough_memory{true};
    in_parallel(threads, frame.count, 4 * isa.sph->rows, [&](int thread, int32_t begin, int32_t end) {
        if (!enough_memory || pairs > max_pairs) return;
        const auto t = static_cast<size_t>(thread);
        const int64_t found = isa.sph->find_neighbors(frame, begin, end, arenas_[t], searching_[t], searches_[t].data());
        found < 0 ? void(enough_memory = false) : void(pairs += found);
    });
    if (!enough_memory) throw std::bad_alloc();
    return pairs;
}

// Places what moves at the start of a substep.
void Solver::place_moving(const MovingSolids& moving, int substep, MovingFrame& placed) {
    const double from = static_cast<double>(substep) / parameters_.substeps,
                 to = static_cast<double>(substep + 1) / parameters_.substeps;
    const double time = parameters_.substep_time();
    moving_boundaries_.resize(moving.solids.size());
    for (size_t k = 0; k < moving.solids.size(); ++k) {
        const MovingSolid& solid = moving.solids[k];
        MovingBoundary& boundary = moving_boundaries_[k];
        boundary.step = solid.motion.step(from, to, from, time);
        boundary.boundary_map = solid.boundary_map;
        std::copy_n(boundary.step.place.rotation, 9, boundary.boundary_map.rotation);
        for (int axis = 0; axis < 3; ++axis) {
            boundary.lower[axis] = solid.lower[axis] - parameters_.kernel_support;
            boundary.upper[axis] = solid.upper[axis] + parameters_.kernel_support;
        }
    }
    if (moving.walls) moving_walls_ = moving.walls->step(from, to, from, time);
    placed = {moving.walls ? &moving_walls_ : nullptr, moving_boundaries_.data(), static_cast<int32_t>(moving.solids.size()),
              solid_rate_.data()};
}

// The pressure p of a particle changes its velocity by -p times the boundary's density gradient. The work of a solid is that
// impulse times the solid's velocity.
void Solver::add_solid_work(int32_t count, double mass) {
    double work = 0;
    for (size_t i = 0; i < static_cast<size_t>(count); ++i)
        work -= pressure_[static_cast<size_t>(PRESSURE_ROW) * i + 3] * solid_rate_[i];
    solid_work_ += work / mass;
}

// Adds the impulses of the present pressures. Every portion of the particles has a sum of its own, so that the result does not
// depend on the number of threads.
void Solver::add_impulses(const Frame& frame, const Isa& isa, int threads, const ImpulseSums& sums) {
    const int32_t portion = 4 * isa.sph->rows, portions = (frame.count + portion - 1) / portion;
    const auto width = static_cast<size_t>(IMPULSE_ROW) * static_cast<size_t>(sums.count);
    portion_impulses_.assign(width * static_cast<size_t>(portions), 0.0);
    in_parallel(threads, frame.count, portion, [&](int, int32_t begin, int32_t end) {
        isa.sph->sum_impulses(frame, sums, begin, end, &portion_impulses_[width * static_cast<size_t>(begin / portion)]);
    });
    for (size_t k = 0; k < portion_impulses_.size(); ++k) sums.rows[k % width] += portion_impulses_[k];
}

int64_t Solver::advance(const Fluid& fluid, float* positions, float* velocities, const SubstepRecord& record, const Isa& isa,
                        int threads, int64_t max_pairs) {
    const std::lock_guard<std::mutex> alone(stepping_);
    if (fluid.count == 0) return 0;
    Frame frame{};
    const bool finite = prepare(fluid, frame);
    frame.new_positions = positions, frame.new_velocities = velocities;
    frame.record = record;
    const int workers = std::max(1, threads);
    const int64_t pairs = find_neighbors(frame, isa, workers, max_pairs);
    if (pairs > max_pairs) return pairs;
    const int32_t portion = 4 * isa.sph->rows;
    MovingFrame moving{};
    solid_work_ = 0;
    if (fluid.moving) {
        solid_rate_.resize(static_cast<size_t>(fluid.count));
        frame.moving = &moving;
    }
    liquid_.forget_work();
    if (fluid.liquid) {
        if (fluid.liquid->implicit_viscosity) frame.parameters = &without_viscosity_;
        liquid_.begin(fluid.liquid, fluid.masses ? liquid_of_.data() : nullptr, frame, isa, workers);
    }
    for (int substep = 0; substep < parameters_.substeps; ++substep) {
        if (fluid.moving) place_moving(*fluid.moving, substep, moving);
        if (fluid.liquid) {
            liquid_.advance(frame, substep);
            if (fluid.impulses) liquid_.add_impulses(frame, *fluid.impulses);
        }
        in_parallel(workers, fluid.count, portion,
                    [&](int, int32_t begin, int32_t end) { isa.sph->compute_pressures(frame, substep, begin, end); });
        if (fluid.impulses) add_impulses(frame, isa, workers, *fluid.impulses);
        in_parallel(workers, fluid.count, portion,
                    [&](int, int32_t begin, int32_t end) { isa.sph->apply_pressures(frame, substep, begin, end); });
        if (fluid.moving) add_solid_work(fluid.count, total_mass(fluid.masses, fluid.count));
    }
    return finite ? pairs : -1;
}

}  // namespace surfsup
