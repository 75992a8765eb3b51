#include "sph/cell_list.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace surfsup {
namespace {

constexpr double WIDER = 1.0001;      // than the radius: rounding must not put neighbors two cells apart
constexpr double FARTHEST = 1 << 20;  // cells from the first; what has flown farther shares the last one
constexpr int64_t CELLS_A_PARTICLE = 4;

// A cell's number along one axis; what is no number goes anywhere, for it has no neighbors.
int32_t cell_along(double place) {
    if (!(place > 0)) return 0;
    return static_cast<int32_t>(std::min(place, FARTHEST));
}

}  // namespace

bool CellList::sort(const float* positions, int32_t count, float radius) {
    double lowest[3], highest[3];
    std::fill_n(lowest, 3, std::numeric_limits<double>::infinity());
    std::fill_n(highest, 3, -std::numeric_limits<double>::infinity());
    bool finite = true;
    for (int64_t i = 0; i < count; ++i)
        for (int axis = 0; axis < 3; ++axis) {
            const double place = positions[3 * i + axis];
            finite = finite && std::isfinite(place);
            if (!std::isfinite(place)) continue;
            lowest[axis] = std::min(lowest[axis], place);
            highest[axis] = std::max(highest[axis], place);
        }
    // At least a tile an axis: then the 27 cells around a particle are 27 different ones even when counted modulo.
    const double width = radius * WIDER;
    for (int axis = 0; axis < 3; ++axis) size_[axis] = cell_along((highest[axis] - lowest[axis]) / width) / TILE + 1;
    constexpr int CELLS = TILE * TILE * TILE;
    while (static_cast<double>(size_[0]) * size_[1] * size_[2] * CELLS > CELLS_A_PARTICLE * count + 8.0 * CELLS) {
        int32_t& longest = *std::max_element(size_, size_ + 3);
        longest = (longest + 1) / 2;
    }
    const int64_t total = static_cast<int64_t>(size_[0]) * size_[1] * size_[2] * CELLS;

    first_.assign(static_cast<size_t>(total + 1), 0);
    unsorted_.resize(static_cast<size_t>(count));
    of_.resize(static_cast<size_t>(count));
    order_.resize(static_cast<size_t>(count));
    for (int64_t i = 0; i < count; ++i) {
        int32_t tile = 0, in_tile = 0;
        for (int axis = 0; axis < 3; ++axis) {
            const int32_t place = cell_along((positions[3 * i + axis] - lowest[axis]) / width) % (TILE * size_[axis]);
            tile = tile * size_[axis] + place / TILE;
            in_tile = in_tile * TILE + place % TILE;
        }
        const int32_t cell = tile * CELLS + in_tile;
        unsorted_[static_cast<size_t>(i)] = cell;
        ++first_[static_cast<size_t>(cell) + 1];
    }
    for (int64_t cell = 0; cell < total; ++cell)
        first_[static_cast<size_t>(cell) + 1] += first_[static_cast<size_t>(cell)];
    // From the last particle to the first, so that a cell keeps the caller's order; `first_` ends where it began.
    for (int64_t i = count - 1; i >= 0; --i) {
        const int32_t cell = unsorted_[static_cast<size_t>(i)];
        const int32_t at = --first_[static_cast<size_t>(cell) + 1];
        order_[static_cast<size_t>(at)] = static_cast<int32_t>(i);
        of_[static_cast<size_t>(at)] = cell;
    }
    // Now first_[cell + 1] is where the cell begins.
    std::rotate(first_.begin(), first_.begin() + 1, first_.end());
    first_.back() = count;
    return finite;
}

Cells CellList::cells() const { return {{size_[0], size_[1], size_[2]}, first_.data(), of_.data()}; }

}  // namespace surfsup
