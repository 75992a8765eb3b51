// The solid enclosed by triangles: grids far from the surface, the triangles near it. See surfsup.sdf.mesh.surface.
#pragma once

#include <functional>
#include <memory>

#include "sdf/sampled_shape.hpp"
#include "sdf/triangle_bvh.hpp"

namespace surfsup {

// The memory that it refers to must live as long as the pointer that MeshShape holds.
struct MeshDistance {
    const TriangleBvh* bvh;
    SdfGrid<double> fine, coarse;
    const double* node_distance;  // signed, at the nodes of the fine grid
    double mesh_range;            // distance on the grid below which the triangles are queried, meters
    double min_agreement;         // length of the gradient on the grid below which the triangles are queried
    double on_surface;            // distance below which rounding dominates the direction of the normal, meters
    // Writes distance (count) and normal (count, 3) of points (count, 3) whose side of the surface is not known.
    std::function<void(const float* points, int32_t count, float* distance, float* normal)> query_undecided;
};

class MeshShape : public SampledShape {
public:
    explicit MeshShape(std::shared_ptr<const MeshDistance> mesh) : mesh_(std::move(mesh)) {}

    void sample(const Isa&, const float* points, int32_t count, const Samples&, int32_t* indices,
                float* scratch) const override;
    void sample_undecided(const float* points, int32_t count, float* distance, float* normal) const override {
        mesh_->query_undecided(points, count, distance, normal);
    }

private:
    std::shared_ptr<const MeshDistance> mesh_;
};

}  // namespace surfsup
