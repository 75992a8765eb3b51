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
    frame.neighbors = neighbors_.data();
    frame.work = work_.data();
    frame.motion = motion_.data(), frame.pressure = pressure_.data();
    return finite;
}

int64_t Solver::find_neighbors(const Frame& frame, const Isa& isa, int threads, int64_t max_pairs) {
    for (auto* arenas : {&arenas_, &searching_}) {
        arenas->resize(std::max(arenas->size(), static_cast<size_t>(threads)));
        for (Arena& arena : *arenas) arena.reset();
    }
    searches_.assign(static_cast<size_t>(threads), std::vector<char>(static_cast<size_t>(isa.search_bytes)));
    std::atomic<int64_t> pairs{0};
    std::atomic<bool> enough_memory{true};
    in_parallel(threads, frame.count, 4 * isa.rows, [&](int thread, int32_t begin, int32_t end) {
        if (!enough_memory || pairs > max_pairs) return;
        const auto t = static_cast<size_t>(thread);
        const int64_t found = isa.find_neighbors(frame, begin, end, arenas_[t], searching_[t], searches_[t].data());
        found < 0 ? void(enough_memory = false) : void(pairs += found);
    });
    if (!enough_memory) throw std::bad_alloc();
    return pairs;
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
    const int32_t portion = 4 * isa.rows;
    for (int substep = 0; substep < parameters_.substeps; ++substep) {
        in_parallel(workers, fluid.count, portion,
                    [&](int, int32_t begin, int32_t end) { isa.compute_pressures(frame, substep, begin, end); });
        in_parallel(workers, fluid.count, portion,
                    [&](int, int32_t begin, int32_t end) { isa.apply_pressures(frame, substep, begin, end); });
    }
    return finite ? pairs : -1;
}

}  // namespace surfsup
