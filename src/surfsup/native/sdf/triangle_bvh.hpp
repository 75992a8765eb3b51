// The nearest point on a triangle mesh, by a bounding volume hierarchy.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sdf/grid.hpp"

namespace surfsup {

// A hierarchy of axis-aligned boxes. The nearest triangle is searched in single precision, which needs half the memory; the
// nearest point on it is computed in double precision.
class TriangleBvh {
public:
    // Vertices (vertex_count, 3) in meters and faces (face_count, 3). Throws std::out_of_range for an invalid vertex
    // index and a vertex that is not finite.
    TriangleBvh(const double* vertices, int64_t vertex_count, const int64_t* faces, int64_t face_count);

    struct Nearest {
        double distance;
        int64_t face;
        Point closest;  // on the face
    };

    // The nearest triangle, which is not beyond `max_distance`; a smaller bound makes the search faster.
    Nearest nearest(const Point& point, double max_distance) const;

    // Distance, face and closest point (count, 3) of points (count, 3). `max_distance` (count) may be null.
    void nearest(const double* points, const double* max_distance, int32_t count, double* distance, int64_t* face,
                 double* closest, int threads) const;

private:
    using FloatPoint = std::array<float, 3>;  // relative to the center of the mesh

    struct Node {
        FloatPoint lower, upper;
        int32_t first;  // of a leaf the first triangle, else the second child; the first child is the next node
        int32_t count;  // of a leaf the number of triangles, else 0
    };

    int32_t build(const std::vector<FloatPoint>& centroids, int32_t begin, int32_t end);
    int32_t nearest_face(const FloatPoint& point, float squared) const;

    Point center_;
    float rounding_;                                   // error of single precision, meters
    std::vector<std::array<Point, 3>> exact_corners_;  // of each face
    std::vector<std::array<FloatPoint, 3>> corners_;   // in the order of the leaves
    std::vector<int32_t> faces_;                       // face of each triangle in the order of the leaves
    std::vector<Node> nodes_;
};

}  // namespace surfsup
