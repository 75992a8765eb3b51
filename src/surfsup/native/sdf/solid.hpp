// Solids made of those whose distance has a closed form, or is known by a network or a mesh; the same forms as in
// surfsup/sdf, and tested against them.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "sdf/leaf.hpp"
#include "sdf/tree.hpp"

namespace surfsup {

// How a part lies in a whole: scaled, then turned by `rotation` (row by row), then moved.
struct Similarity {
    float rotation[9], move[3], scale;
};

class Solid {
public:
    // Throws std::invalid_argument where there is no such kind, or it is made of other things.
    Solid(const std::string& kind, const std::vector<float>& numbers, const std::vector<const Solid*>& parts);

    // One without parts, in its own frame.
    explicit Solid(std::shared_ptr<const Leaf> leaf);

    // Distance (count) and unit normal (count, 3), unless that is null, of points (count, 3).
    void look(const float* points, int32_t count, float* distance, float* normal, const Isa& isa, int threads) const;

private:
    struct Placed {
        std::shared_ptr<const Leaf> leaf;
        std::vector<Similarity> lies;  // in the whole first, then in what of it lies so, and so on
    };
    void look_at(const Placed& placed, const Isa& isa, const float* points, int32_t count, const LeafLook& to, int threads) const;

    std::vector<Node> nodes_;
    std::vector<float> numbers_;
    std::vector<int32_t> parts_;
    std::vector<Placed> leaves_;
};

}  // namespace surfsup
