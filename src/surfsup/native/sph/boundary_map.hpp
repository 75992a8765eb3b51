// The solid as the solver feels it, see solid_map.py.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace surfsup {

constexpr int NODES = 32;

// A cell's nodes lie side by side: their distances, then their shares. What is in no cell is as in the last one.
struct MapView {
    float lower[3], per_cell[3];  // meters, cells a meter
    int32_t resolution[3];
    float turn[9];                // rows; points are looked up where its transpose takes them
    const int32_t* places;        // nullptr where there is no map
    const float* nodes;
    int64_t last;
};

// What keeps the tables of a map.
struct SolidMap {
    std::vector<float> lower, per_cell, nodes;
    std::vector<int32_t> resolution, places;

    MapView view(const float* turn) const {
        MapView view{};
        for (int axis = 0; axis < 3; ++axis) {
            const auto a = static_cast<size_t>(axis);
            view.lower[axis] = lower[a], view.per_cell[axis] = per_cell[a], view.resolution[axis] = resolution[a];
        }
        for (int k = 0; k < 9; ++k) view.turn[k] = turn[k];
        view.places = places.data();
        view.nodes = nodes.data();
        view.last = static_cast<int64_t>(nodes.size()) / (2 * NODES) - 1;
        return view;
    }
};

}  // namespace surfsup
