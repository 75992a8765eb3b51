// Particles sorted by grid cell.
#pragma once

#include <cstdint>
#include <vector>

#include "sph/frame.hpp"

namespace surfsup {

class CellList {
public:
    // Sorts positions (count, 3). Cells are slightly wider than the kernel support, so that all neighbors of a particle are in
    // the 27 cells around its own. False where a position is not finite.
    bool sort(const float* positions, int32_t count, float kernel_support);

    Cells cells() const;
    // The caller's index of each sorted particle.
    const int32_t* order() const { return order_.data(); }

private:
    int32_t size_[3] = {1, 1, 1};  // in tiles
    std::vector<int32_t> first_, cell_of_, order_, unsorted_;
};

}  // namespace surfsup
