#include "sph/liquid_solver.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/threads.hpp"
#include "sph/collision.hpp"

namespace surfsup {
namespace {

constexpr float FAR_AWAY = 1e6f;  // meters

// z = M r with a symmetric matrix.
inline void times_symmetric(const float* matrix, const float* r, float* z) {
    z[0] = matrix[0] * r[0] + matrix[3] * r[1] + matrix[4] * r[2];
    z[1] = matrix[3] * r[0] + matrix[1] * r[1] + matrix[5] * r[2];
    z[2] = matrix[4] * r[0] + matrix[5] * r[1] + matrix[2] * r[2];
}

}  // namespace

void LiquidSolver::begin(const LiquidParameters* parameters, const int32_t* liquid_of, Frame& frame, const Isa& isa,
                         int threads) {
    isa_ = &isa, threads_ = threads, count_ = frame.count;
    mass_ = total_mass(frame.masses, count_);
    attracts_ = false;
    for (int32_t i = 0; i < (liquid_of ? count_ : 1); ++i)
        attracts_ = attracts_ || parameters[liquid_of ? liquid_of[i] : 0].attracts();
    forget_work();
    const auto count = static_cast<size_t>(count_);
    rows_.resize(LIQUID_ROW * (count + 1));
    friction_.resize(FRICTION_ROW * count);
    inverse_diagonal_.resize(SYMMETRIC * count);
    for (auto* vectors : {&start_, &change_, &solution_, &residual_, &product_}) vectors->resize(3 * count);
    float* padding = &rows_[LIQUID_ROW * count];
    std::fill_n(padding, 3, FAR_AWAY);
    padding[3] = 1.0f;
    std::fill_n(padding + 4, 4, 0.0f);
    liquid_ = {parameters,    liquid_of,      rows_.data(),     friction_.data(), inverse_diagonal_.data(),
               start_.data(), change_.data(), solution_.data(), residual_.data(), product_.data()};
    frame.liquid = &liquid_;
}

// Every portion of the particles has a sum of its own, so that the result does not depend on the number of threads.
double LiquidSolver::sum_of(const Range& part) {
    const int32_t portion = 4 * isa_->sph->rows;
    portions_.assign(static_cast<size_t>((count_ + portion - 1) / portion), 0.0);
    in_parallel(threads_, count_, portion,
                [&](int, int32_t begin, int32_t end) { portions_[static_cast<size_t>(begin / portion)] = part(begin, end); });
    double total = 0;
    for (const double value : portions_) total += value;
    return total;
}

double LiquidSolver::kinetic_energy(const Frame& frame, int substep) {
    const float elapsed = static_cast<float>(substep) * frame.parameters->substep_time();
    const double total = sum_of([&](int32_t begin, int32_t end) {
        double sum = 0;
        for (int32_t i = begin; i < end; ++i) {
            const double half = 0.5 * (frame.masses ? frame.masses[i] : 1.0f);
            for (int axis = 0; axis < 3; ++axis) {
                const double v = frame.motion[MOTION_ROW * static_cast<int64_t>(i) + 4 + axis] + elapsed * frame.gravity[axis];
                sum += half * v * v;
            }
        }
        return sum;
    });
    return total / mass_;
}

void LiquidSolver::advance(Frame& frame, int substep) {
    const double before = kinetic_energy(frame, substep);
    sum_of([&](int32_t begin, int32_t end) { return isa_->sph->measure_liquid(frame, substep, begin, end), 0.0; });
    if (attracts_) {
        sum_of([&](int32_t begin, int32_t end) { return isa_->sph->find_surface_normals(frame, begin, end), 0.0; });
        sum_of([&](int32_t begin, int32_t end) { return isa_->sph->apply_tension(frame, begin, end), 0.0; });
    }
    const double attracted = kinetic_energy(frame, substep);
    work_ += attracted - before;
    if (!liquid_.parameters->implicit_viscosity) return;
    solve_viscosity(frame, substep);
    if (frame.moving) work_ += std::max(0.0, kinetic_energy(frame, substep) - attracted);
}

// Solves (I + Δt B - Δt L) v' = v + Δt B v_solid for the velocities v', with friction B and the Laplacian L. The first guess
// adds what viscosity changed in the substep before.
void LiquidSolver::solve_viscosity(Frame& frame, int substep) {
    const float time = frame.parameters->substep_time(), elapsed = static_cast<float>(substep) * time;
    const auto at = [](int32_t i) { return 3 * static_cast<int64_t>(i); };
    const auto direction = [&](int32_t i) { return &rows_[static_cast<size_t>(LIQUID_ROW) * static_cast<size_t>(i) + 4]; };
    if (frame.masses)
        for (int32_t i = 0; i < count_; ++i) {
            const LiquidParameters& own = liquid_.parameters[liquid_.liquid_of[i]];
            direction(i)[3] = own.mass * own.viscosity;
        }
    const auto multiply = [&] {
        return sum_of([&](int32_t begin, int32_t end) { return isa_->sph->multiply_viscosity(frame, begin, end); });
    };
    sum_of([&](int32_t begin, int32_t end) {
        isa_->sph->prepare_viscosity(frame, begin, end);
        for (int32_t i = begin; i < end; ++i)
            for (int axis = 0; axis < 3; ++axis) {
                const int64_t k = at(i) + axis;
                const float velocity = frame.motion[MOTION_ROW * static_cast<int64_t>(i) + 4 + axis];
                liquid_.start[k] = velocity + elapsed * frame.gravity[axis];
                liquid_.solution[k] = liquid_.start[k] + (substep == 0 ? 0.0f : liquid_.change[k]);
                direction(i)[axis] = liquid_.solution[k];
            }
        return 0.0;
    });
    multiply();
    double squared = 0;
    double product = sum_of([&](int32_t begin, int32_t end) {
        double sum = 0;
        for (int32_t i = begin; i < end; ++i) {
            float* r = liquid_.residual + at(i);
            const float* moved = liquid_.friction + FRICTION_ROW * static_cast<int64_t>(i) + SYMMETRIC;
            for (int axis = 0; axis < 3; ++axis) {
                const float start = liquid_.start[at(i) + axis], momentum = frame.masses ? frame.masses[i] * start : start;
                r[axis] = momentum + time * moved[axis] - liquid_.product[at(i) + axis];
            }
            times_symmetric(liquid_.inverse_diagonal + SYMMETRIC * static_cast<int64_t>(i), r, direction(i));
            for (int axis = 0; axis < 3; ++axis) sum += static_cast<double>(r[axis]) * direction(i)[axis];
        }
        return sum;
    });
    const auto square_of_residual = [&] {
        return sum_of([&](int32_t begin, int32_t end) {
            double sum = 0;
            for (int64_t k = at(begin); k < at(end); ++k) sum += static_cast<double>(liquid_.residual[k]) * liquid_.residual[k];
            return sum;
        });
    };
    squared = square_of_residual();
    const double enough = static_cast<double>(liquid_.parameters->tolerance) * liquid_.parameters->tolerance * count_;
    for (int iteration = 0; iteration < liquid_.parameters->max_iterations && squared > enough; ++iteration) {
        ++iterations_;
        const double length = product / multiply();
        if (!std::isfinite(length)) break;
        double next = sum_of([&](int32_t begin, int32_t end) {
            double sum = 0;
            for (int32_t i = begin; i < end; ++i) {
                float *r = liquid_.residual + at(i), *x = liquid_.solution + at(i), z[3];
                for (int axis = 0; axis < 3; ++axis) {
                    x[axis] += static_cast<float>(length) * direction(i)[axis];
                    r[axis] -= static_cast<float>(length) * liquid_.product[at(i) + axis];
                }
                times_symmetric(liquid_.inverse_diagonal + SYMMETRIC * static_cast<int64_t>(i), r, z);
                for (int axis = 0; axis < 3; ++axis) sum += static_cast<double>(r[axis]) * z[axis];
            }
            return sum;
        });
        const auto turn = static_cast<float>(next / product);
        product = next;
        squared = sum_of([&](int32_t begin, int32_t end) {
            double sum = 0;
            for (int32_t i = begin; i < end; ++i) {
                const float* r = liquid_.residual + at(i);
                float z[3];
                times_symmetric(liquid_.inverse_diagonal + SYMMETRIC * static_cast<int64_t>(i), r, z);
                for (int axis = 0; axis < 3; ++axis) {
                    direction(i)[axis] = z[axis] + turn * direction(i)[axis];
                    sum += static_cast<double>(r[axis]) * r[axis];
                }
            }
            return sum;
        });
    }
    // With its residual the solution is what the pair forces of the solution make of the start: momentum is conserved however
    // early the iterations end.
    sum_of([&](int32_t begin, int32_t end) {
        for (int32_t i = begin; i < end; ++i) {
            const float mass = frame.masses ? frame.masses[i] : 1.0f;
            for (int axis = 0; axis < 3; ++axis) {
                const int64_t k = at(i) + axis;
                liquid_.change[k] = liquid_.solution[k] + liquid_.residual[k] / mass - liquid_.start[k];
                frame.motion[MOTION_ROW * static_cast<int64_t>(i) + 4 + axis] += liquid_.change[k];
                frame.work[i].delta_velocity[axis] += liquid_.change[k];
            }
        }
        return 0.0;
    });
}

void LiquidSolver::add_impulses(const Frame& frame, const ImpulseSums& sums) {
    const int32_t portion = 4 * isa_->sph->rows;
    const auto width = static_cast<size_t>(IMPULSE_ROW) * static_cast<size_t>(sums.count);
    portions_.assign(width * static_cast<size_t>((count_ + portion - 1) / portion), 0.0);
    in_parallel(threads_, count_, portion, [&](int, int32_t begin, int32_t end) {
        isa_->sph->sum_liquid_impulses(frame, sums, begin, end, &portions_[width * static_cast<size_t>(begin / portion)]);
    });
    for (size_t k = 0; k < portions_.size(); ++k) sums.rows[k % width] += portions_[k];
}

}  // namespace surfsup
