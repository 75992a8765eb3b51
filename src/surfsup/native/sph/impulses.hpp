// The impulses of the fluid on solids and walls: sums by solid. Every change of a particle's velocity by a solid is added with
// the opposite sign, so that momentum is conserved.
#pragma once

#include <cstdint>

namespace surfsup {

// Impulse, and its moment about the origin of the world, of particles of unit mass: m/s and m²/s.
constexpr int IMPULSE_ROW = 6;

// Rows for the walls, then the solids that stand still, then those that move.
struct ImpulseSums {
    double* rows;                // (count, IMPULSE_ROW)
    int32_t count, still_count;  // of all rows, and of those of still solids
    const int32_t* still_solid;  // of each particle: which of the still solids it is at; null pointer where there is but one
    const float* masses;         // of each particle; null pointer where all are 1

    int32_t still_row(int64_t particle) const { return 1 + (still_solid ? still_solid[particle] : 0); }
    int32_t moving_row(int32_t number) const { return 1 + still_count + number; }
};

// Adds an impulse at a position to a row. Inlined, as the code of an instruction set must not share it with other code.
[[gnu::always_inline]] inline void add_impulse(double* row, const float* position, const double* impulse) {
    const double x = position[0], y = position[1], z = position[2];
    for (int axis = 0; axis < 3; ++axis) row[axis] += impulse[axis];
    row[3] += y * impulse[2] - z * impulse[1];
    row[4] += z * impulse[0] - x * impulse[2];
    row[5] += x * impulse[1] - y * impulse[0];
}

// Adds what changes of a particle's velocity take from it, from construction to each call. Does nothing without sums.
class VelocityWatch {
public:
    VelocityWatch(const ImpulseSums* sums, int64_t particle, const float* position, const float* velocity)
        : sums_(sums), mass_(sums && sums->masses ? sums->masses[particle] : 1.0), position_(position), velocity_(velocity) {
        if (sums_) remember();
    }
    // The change since the last call is due to the solid of a row.
    void add_to(int32_t row) {
        if (!sums_) return;
        double impulse[3];
        for (int axis = 0; axis < 3; ++axis) impulse[axis] = mass_ * (static_cast<double>(before_[axis]) - velocity_[axis]);
        add_impulse(sums_->rows + IMPULSE_ROW * static_cast<int64_t>(row), position_, impulse);
        remember();
    }

private:
    void remember() {
        for (int axis = 0; axis < 3; ++axis) before_[axis] = velocity_[axis];
    }
    const ImpulseSums* sums_;
    double mass_;
    const float *position_, *velocity_;
    float before_[3] = {0, 0, 0};
};

}  // namespace surfsup
