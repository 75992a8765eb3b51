// Impulses of the pressure on solids and walls, compiled once for every instruction set.
#pragma once

#include "sph/boundary_isa.hpp"
#include "sph/impulses.hpp"

namespace ISA {
namespace {

using namespace surfsup;

// Adds the impulses of particles begin to end in the present substep to `rows`. Its pressure p changes the velocity of a
// particle by -p times the density gradient of a solid. This runs between the two passes of a substep, so that frames without
// it are as fast as they can be; the gradients are computed again.
void sum_impulses(const Frame& frame, const ImpulseSums& sums, int32_t begin, int32_t end, double* rows) {
    const auto add = [&](int32_t row, const float* position, float pressure, const float* gradient) {
        double impulse[3];
        for (int axis = 0; axis < 3; ++axis) impulse[axis] = static_cast<double>(pressure) * gradient[axis];
        add_impulse(rows + IMPULSE_ROW * static_cast<int64_t>(row), position, impulse);
    };
    for (int32_t i = begin; i < end; ++i) {
        const float* position = frame.pressure + PRESSURE_ROW * static_cast<int64_t>(i);
        const float pressure = position[3];
        if (pressure == 0.0f) continue;
        const int64_t caller = frame.order[i];
        float density = 0.0f, solid_rate = 0.0f, gradient[3] = {0, 0, 0};
        add_walls_of_frame(frame, position, density, gradient, solid_rate);
        add(0, position, pressure, gradient);
        float min_solid_distance = frame.work[i].min_solid_distance, still_gradient[3] = {0, 0, 0};
        add_still_solid(frame, caller, position, min_solid_distance, density, still_gradient);
        if (sums.still_count > 0) add(sums.still_row(caller), position, pressure, still_gradient);
        for (int32_t k = 0; frame.moving && k < frame.moving->solid_count; ++k) {
            float moving_gradient[3] = {0, 0, 0};
            add_moving_solid(*frame.parameters, frame.moving->solids[k], position, density, moving_gradient, solid_rate);
            add(sums.moving_row(k), position, pressure, moving_gradient);
        }
    }
}

}  // namespace
}  // namespace ISA
