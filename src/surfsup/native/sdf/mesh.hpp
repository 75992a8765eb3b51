// The solid that triangles enclose, by grids and, near it, by the triangles themselves: see mesh.py.
#pragma once

#include <functional>
#include <memory>

#include "sdf/leaf.hpp"
#include "sdf/triangles.hpp"

namespace surfsup {

// What it is made of; what that points to lives as long as the pointer to it is held.
struct Mesh {
    const Triangles* triangles;
    Grid fine, coarse;
    const double* unsigned_distance;  // of the fine grid's nodes
    const bool* inside;               // of the same
    double near;       // meters by the grid up to which the triangles are asked
    double agree;      // length of the gradient below which they are asked, too
    double touching;   // meters from the surface up to which rounding decides where the normal points
    // Distance (count) and normal (count, 3) of points (count, 3) of which is not known on which side they are.
    std::function<void(const float* points, int32_t count, float* distance, float* normal)> rest;
};

class MeshLeaf : public Leaf {
public:
    explicit MeshLeaf(std::shared_ptr<const Mesh> mesh) : mesh_(std::move(mesh)) {}

    void look(const Isa&, const float* points, int32_t count, const LeafLook& to, int32_t*, float*) const override;
    void look_at_rest(const float* points, int32_t count, float* distance, float* normal) const override {
        mesh_->rest(points, count, distance, normal);
    }

private:
    std::shared_ptr<const Mesh> mesh_;
};

}  // namespace surfsup
