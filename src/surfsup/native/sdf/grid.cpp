#include "sdf/grid.hpp"

#include <algorithm>

#include "runtime/threads.hpp"

namespace surfsup {

constexpr int32_t CHUNK = 256;  // points per task of a thread

double interpolate(const SdfGrid<double>& grid, const Point& point, Point& gradient) {
    const Vector4 mean = interpolate_table(grid, point.data());
    double distance = mean[0];
    for (size_t axis = 0; axis < 3; ++axis) {
        gradient[axis] = mean[1 + axis];
        distance += 0.5 * (point[axis] - grid.center[axis]) * gradient[axis];
    }
    return distance;
}

void interpolate(const SdfGrid<double>& grid, const double* points, int32_t count, double* distance, double* gradient,
                 int threads) {
    in_parallel(threads, count, CHUNK, [&](int, int32_t begin, int32_t end) {
        for (int64_t i = begin; i < end; ++i) {
            Point mean;
            distance[i] = interpolate(grid, {points[3 * i], points[3 * i + 1], points[3 * i + 2]}, mean);
            std::copy(mean.begin(), mean.end(), gradient + 3 * i);
        }
    });
}

}  // namespace surfsup
