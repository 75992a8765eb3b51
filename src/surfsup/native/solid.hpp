// Solids made of those whose distance has a closed form; the same forms as in surfsup/sdf, and tested against them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tree.hpp"

namespace surfsup {

class Solid {
public:
    // Throws std::invalid_argument where there is no such kind, or it is made of other things.
    Solid(const std::string& kind, const std::vector<float>& numbers, const std::vector<const Solid*>& parts);

    // Distance (count) and unit normal (count, 3) of points (count, 3).
    void look(const float* points, int32_t count, float* distance, float* normal, int threads) const;

private:
    std::vector<Node> nodes_;
    std::vector<float> numbers_;
    std::vector<int32_t> parts_;
};

}  // namespace surfsup
