#include "sph/cell_list.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace surfsup {
namespace {

constexpr double CELL_SCALE = 1.0001;  // cell side over kernel support: rounding must not put neighbors two cells apart
constexpr double MAX_CELL = 1 << 20;   // along an axis; particles beyond share the last cell
constexpr int64_t CELLS_PER_PARTICLE = 4;

// Cell coordinate along one axis. NaN goes to cell 0: it has no neighbors anyway.
int32_t cell_along(double coordinate) {
    if (!(coordinate > 0)) return 0;
    return static_cast<int32_t>(std::min(coordinate, MAX_CELL));
}

}  // namespace

bool CellList::sort(const float* positions, int32_t count, float kernel_support) {
    double lowest[3], highest[3];
    std::fill_n(lowest, 3, std::numeric_limits<double>::infinity());
    std::fill_n(highest, 3, -std::numeric_limits<double>::infinity());
    bool finite = true;
    for (int64_t i = 0; i < count; ++i)
        for (int axis = 0; axis < 3; ++axis) {
            const double coordinate = positions[3 * i + axis];
            finite = finite && std::isfinite(coordinate);
            if (!std::isfinite(coordinate)) continue;
            lowest[axis] = std::min(lowest[axis], coordinate);
            highest[axis] = std::max(highest[axis], coordinate);
        }
    // At least one tile per axis: the 27 cells around a particle must stay distinct modulo the grid size.
    const double width = kernel_support * CELL_SCALE;
    for (int axis = 0; axis < 3; ++axis) size_[axis] = cell_along((highest[axis] - lowest[axis]) / width) / TILE + 1;
    constexpr int CELLS = TILE * TILE * TILE;
    while (static_cast<double>(size_[0]) * size_[1] * size_[2] * CELLS > CELLS_PER_PARTICLE * count + 8.0 * CELLS) {
        int32_t& longest = *std::max_element(size_, size_ + 3);
        longest = (longest + 1) / 2;
    }
    const int64_t total = static_cast<int64_t>(size_[0]) * size_[1] * size_[2] * CELLS;

    first_.assign(static_cast<size_t>(total + 1), 0);
    unsorted_.resize(static_cast<size_t>(count));
    cell_of_.resize(static_cast<size_t>(count));
    order_.resize(static_cast<size_t>(count));
    for (int64_t i = 0; i < count; ++i) {
        int32_t tile = 0, in_tile = 0;
        for (int axis = 0; axis < 3; ++axis) {
            const int32_t coordinate = cell_along((positions[3 * i + axis] - lowest[axis]) / width) % (TILE * size_[axis]);
            tile = tile * size_[axis] + coordinate / TILE;
            in_tile = in_tile * TILE + coordinate % TILE;
        }
        const int32_t cell = tile * CELLS + in_tile;
        unsorted_[static_cast<size_t>(i)] = cell;
        ++first_[static_cast<size_t>(cell) + 1];
    }
    for (int64_t cell = 0; cell < total; ++cell) first_[static_cast<size_t>(cell) + 1] += first_[static_cast<size_t>(cell)];
    // Counting sort from the last particle to the first, which keeps the caller's order within a cell.
    for (int64_t i = count - 1; i >= 0; --i) {
        const int32_t cell = unsorted_[static_cast<size_t>(i)];
        const int32_t at = --first_[static_cast<size_t>(cell) + 1];
        order_[static_cast<size_t>(at)] = static_cast<int32_t>(i);
        cell_of_[static_cast<size_t>(at)] = cell;
    }
    // first_[cell + 1] now is the first particle of the cell: shift by one.
    std::rotate(first_.begin(), first_.begin() + 1, first_.end());
    first_.back() = count;
    return finite;
}

Cells CellList::cells() const { return {{size_[0], size_[1], size_[2]}, first_.data(), cell_of_.data()}; }

}  // namespace surfsup
