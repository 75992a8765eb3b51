// Solids made of those whose distance has a closed form, or is known by a network or a mesh; the same forms as in
// surfsup/sdf, and tested against them.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "leaf.hpp"
#include "tree.hpp"

namespace surfsup {

// How a part lies in the whole: scaled, then turned by `rotation` (row by row), then moved.
struct Similarity {
    float rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, move[3] = {0, 0, 0}, scale = 1;
};

class Solid {
public:
    // Throws std::invalid_argument where there is no such kind, or it is made of other things.
    Solid(const std::string& kind, const std::vector<float>& numbers, const std::vector<const Solid*>& parts);

    // One without parts, in its own frame.
    explicit Solid(std::shared_ptr<const Leaf> leaf);

    // Distance (count) and unit normal (count, 3), unless that is null, of points (count, 3).
    void look(const float* points, int32_t count, float* distance, float* normal, int threads) const;

private:
    struct Asked {
        std::shared_ptr<const Leaf> leaf;
        Similarity lies;
    };
    void ask(const Asked& asked, const Path& path, const float* points, int32_t count, const FieldValues& told, int threads) const;

    std::vector<Node> nodes_;
    std::vector<float> numbers_;
    std::vector<int32_t> parts_;
    std::vector<Asked> asked_;
};

}  // namespace surfsup
