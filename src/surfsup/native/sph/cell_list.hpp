// Particles sorted by the cell that they lie in.
#pragma once

#include <cstdint>
#include <vector>

#include "sph/frame.hpp"

namespace surfsup {

class CellList {
public:
    // Sorts `count` positions (count, 3). Cells are a little wider than `radius`, so that all neighbors of a
    // particle lie in the 27 cells around its own. Whether all positions were finite.
    bool sort(const float* positions, int32_t count, float radius);

    Cells cells() const;
    const int32_t* order() const { return order_.data(); }

private:
    int32_t size_[3] = {1, 1, 1};  // in tiles
    std::vector<int32_t> first_, of_, order_, unsorted_;
};

}  // namespace surfsup
