// Boundary volume map of a solid: signed distance and volume fraction in cubic cells, see sph/boundary/boundary_map.py.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace surfsup {

constexpr int NODES = 32;  // of a cubic serendipity cell

// The nodes of a cell are contiguous: their distances, then their volume fractions. The last cell holds the
// values outside all stored cells.
struct BoundaryMapView {
    float lower[3], cells_per_meter[3];
    int32_t resolution[3];
    float rotation[9];            // row by row; points are mapped by its transpose
    const int32_t* cell_indices;  // index of each grid cell among the stored ones, -1 if none; nullptr without a map
    const float* nodes;
    int64_t last_cell;
};

// Owner of the arrays of a map.
struct BoundaryMap {
    std::vector<float> lower, cells_per_meter, nodes;
    std::vector<int32_t> resolution, cell_indices;

    BoundaryMapView view(const float* rotation) const {
        BoundaryMapView view{};
        for (int axis = 0; axis < 3; ++axis) {
            const auto a = static_cast<size_t>(axis);
            view.lower[axis] = lower[a], view.cells_per_meter[axis] = cells_per_meter[a], view.resolution[axis] = resolution[a];
        }
        for (int k = 0; k < 9; ++k) view.rotation[k] = rotation[k];
        view.cell_indices = cell_indices.data();
        view.nodes = nodes.data();
        view.last_cell = static_cast<int64_t>(nodes.size()) / (2 * NODES) - 1;
        return view;
    }
};

}  // namespace surfsup
