// The nearest points of a triangle mesh, and a grid of distances around it: see mesh_query.py and mesh_cache.py.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace surfsup {

using Point = std::array<double, 3>;
using Place = std::array<float, 3>;  // from the middle of the mesh

// Triangles in a tree of boxes. The nearest is looked for in single precision, for half of the memory is twice as near;
// where on it the nearest place is, is then told in double precision.
class Triangles {
public:
    // Vertices (vertex_count, 3) in meters and faces (face_count, 3). Throws std::out_of_range where a face has a corner
    // that there is not.
    Triangles(const double* vertices, int64_t vertex_count, const int64_t* faces, int64_t face_count);

    struct Nearest {
        double distance;
        int64_t face;
        Point place;  // on it
    };

    // The triangle that is nearest to a point, which is no farther than `at_most`: the less, the faster.
    Nearest nearest(const Point& point, double at_most) const;

    // Of points (count, 3) the distance to the nearest triangle, which that is, and the nearest place (count, 3) on it.
    // `at_most`, where it is given, says of each point how far the nearest one can be: the less, the faster.
    void nearest(const double* points, const double* at_most, int32_t count, double* distance, int64_t* face,
                 double* closest, int threads) const;

private:
    struct Node {
        Place lower, upper;
        int32_t first;  // of a leaf the first of its triangles, else the node of the second half; the first half is next
        int32_t count;  // of a leaf how many triangles, else 0
    };

    int32_t build(const std::vector<Place>& middles, int32_t begin, int32_t end);
    int32_t nearest_face(const Place& place, float squared) const;

    Point middle_;
    float rounding_;                             // meters by which single precision may be wrong
    std::vector<std::array<Point, 3>> exact_;    // of each face
    std::vector<std::array<Place, 3>> corners_;  // of each face, then in the order of the leaves
    std::vector<int32_t> faces_;                 // which face each of them is
    std::vector<Node> nodes_;
};

// Nodes of a regular grid, z fastest: of each the base and the gradient that mesh_cache.py explains.
struct Grid {
    const float* table;  // (nodes, 4)
    Point lower, middle;
    double cell;
    std::array<int64_t, 3> nodes;  // along each axis
};

// Distance and mean gradient of a point that lies in the grid.
double sample(const Grid& grid, const Point& point, Point& gradient);

// Distance (count) and mean gradient (count, 3) of points (count, 3), all of which lie in the grid.
void sample(const Grid& grid, const double* points, int32_t count, double* distance, double* gradient, int threads);

}  // namespace surfsup
