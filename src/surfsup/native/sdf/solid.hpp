// Solids of closed-form shapes, networks and meshes, combined by set operations. The formulas are those of surfsup/sdf.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "sdf/sampled_shape.hpp"

namespace surfsup {

// Scale, then rotation (row by row), then translation.
struct Similarity {
    float rotation[9], translation[3], scale;
};

class Solid {
public:
    // Throws std::invalid_argument for an unknown kind, a wrong number of parameters or parts, and too deep a tree.
    Solid(const std::string& kind, const std::vector<float>& parameters, const std::vector<const Solid*>& parts);

    explicit Solid(std::shared_ptr<const SampledShape> shape);

    // Writes signed distance (count) and, unless null, unit normal (count, 3) of points (count, 3).
    void evaluate(const float* points, int32_t count, float* distance, float* normal, const Isa& isa, int threads) const;

private:
    struct PlacedShape {
        std::shared_ptr<const SampledShape> shape;
        std::vector<Similarity> transforms;  // the outermost first
    };
    void sample(const PlacedShape& placed, const Isa& isa, const float* points, int32_t count, const Samples& samples,
                int threads) const;

    int depth_ = 1;  // of the tree
    std::vector<CsgNode> nodes_;
    std::vector<float> parameters_;
    std::vector<int32_t> parts_;
    std::vector<PlacedShape> shapes_;
};

}  // namespace surfsup
