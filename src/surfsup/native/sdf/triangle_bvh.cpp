#include "sdf/triangle_bvh.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "runtime/threads.hpp"

namespace surfsup {
namespace {

using FloatPoint = std::array<float, 3>;

constexpr int32_t MAX_LEAF_SIZE = 8;      // triangles in a leaf
constexpr int32_t CHUNK = 256;            // points per task of a thread
constexpr float BOUND_FACTOR = 1.00001f;  // keeps a triangle at exactly the maximum distance
constexpr double MAX_EXTENT = 1e38;       // of a mesh: single precision holds it
constexpr int STACK_SIZE = 64;            // halving 2^31 triangles gives a depth of 30, with two entries per level

template <typename Vector>
auto dot(const Vector& a, const Vector& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

template <typename Vector>
Vector minus(const Vector& a, const Vector& b) {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

template <typename Vector, typename Number>
Vector plus(const Vector& a, Number s, const Vector& b, Number t, const Vector& c) {
    return {a[0] + s * b[0] + t * c[0], a[1] + s * b[1] + t * c[1], a[2] + s * b[2] + t * c[2]};
}

// The point on a triangle closest to a point (C. Ericson, "Real-Time Collision Detection", 2005, section 5.1.5). Edges of
// length zero are skipped, so that triangles that degenerate to a segment or a point work, too.
template <typename Vector>
Vector closest_on(const std::array<Vector, 3>& triangle, const Vector& point) {
    using Number = typename Vector::value_type;
    const auto& [a, b, c] = triangle;
    const Vector ab = minus(b, a), ac = minus(c, a), ap = minus(point, a);
    const Number d1 = dot(ab, ap), d2 = dot(ac, ap);
    if (d1 <= 0 && d2 <= 0) return a;
    const Vector bp = minus(point, b);
    const Number d3 = dot(ab, bp), d4 = dot(ac, bp);
    if (d3 >= 0 && d4 <= d3) return b;
    const Number vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0 && d1 > d3) return plus(a, d1 / (d1 - d3), ab, Number(0), ac);
    const Vector cp = minus(point, c);
    const Number d5 = dot(ab, cp), d6 = dot(ac, cp);
    if (d6 >= 0 && d5 <= d6) return c;
    const Number vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0 && d2 > d6) return plus(a, Number(0), ab, d2 / (d2 - d6), ac);
    const Number va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0 && (d4 - d3) + (d5 - d6) > 0) {
        const Number fraction = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return plus(b, fraction, minus(c, b), Number(0), ac);
    }
    const Number sum = va + vb + vc;
    return sum > 0 ? plus(a, vb / sum, ab, vc / sum, ac) : a;  // else a triangle without area
}

float squared_distance_to_box(const FloatPoint& lower, const FloatPoint& upper, const FloatPoint& point) {
    float squared = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
        const float beyond = std::max(0.0f, std::max(lower[axis] - point[axis], point[axis] - upper[axis]));
        squared += beyond * beyond;
    }
    return squared;
}

constexpr float INFINITE = std::numeric_limits<float>::infinity();

}  // namespace

TriangleBvh::TriangleBvh(const double* vertices, int64_t vertex_count, const int64_t* faces, int64_t face_count) {
    if (face_count < 1 || face_count > std::numeric_limits<int32_t>::max() / 2)
        throw std::out_of_range("there are no triangles, or too many");
    const auto count = static_cast<size_t>(face_count);
    Point lower, upper;
    lower.fill(std::numeric_limits<double>::infinity());
    upper.fill(-std::numeric_limits<double>::infinity());
    exact_corners_.resize(count);
    bool finite = true;
    for (size_t face = 0; face < count; ++face)
        for (size_t corner = 0; corner < 3; ++corner) {
            const int64_t vertex = faces[3 * face + corner];
            if (vertex < 0 || vertex >= vertex_count) throw std::out_of_range("a face has an invalid vertex index");
            for (size_t axis = 0; axis < 3; ++axis) {
                const double value = vertices[3 * vertex + static_cast<int64_t>(axis)];
                finite = finite && std::isfinite(value);
                exact_corners_[face][corner][axis] = value;
                lower[axis] = std::min(lower[axis], value);
                upper[axis] = std::max(upper[axis], value);
            }
        }
    for (size_t axis = 0; axis < 3; ++axis) finite = finite && upper[axis] - lower[axis] < MAX_EXTENT;
    // Sorting centroids that are not numbers would leave the array.
    if (!finite) throw std::out_of_range("a vertex is not finite, or too far away");
    double extent = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
        center_[axis] = (lower[axis] + upper[axis]) / 2;
        extent = std::max(extent, upper[axis] - lower[axis]);
    }
    rounding_ = static_cast<float>(1e-6 * extent);
    std::vector<std::array<FloatPoint, 3>> corners(count);
    std::vector<FloatPoint> centroids(count);
    for (size_t face = 0; face < count; ++face)
        for (size_t axis = 0; axis < 3; ++axis) {
            centroids[face][axis] = 0;
            for (size_t corner = 0; corner < 3; ++corner) {
                corners[face][corner][axis] = static_cast<float>(exact_corners_[face][corner][axis] - center_[axis]);
                centroids[face][axis] += corners[face][corner][axis] / 3;
            }
        }
    corners_ = corners;
    faces_.resize(count);
    std::iota(faces_.begin(), faces_.end(), 0);
    nodes_.reserve(count);
    build(centroids, 0, static_cast<int32_t>(count));
    for (size_t k = 0; k < count; ++k) corners_[k] = corners[static_cast<size_t>(faces_[k])];
}

int32_t TriangleBvh::build(const std::vector<FloatPoint>& centroids, int32_t begin, int32_t end) {
    const auto index = static_cast<int32_t>(nodes_.size());
    FloatPoint lower{INFINITE, INFINITE, INFINITE}, upper{-INFINITE, -INFINITE, -INFINITE}, min_centroid = lower,
                                                                                            max_centroid = upper;
    for (int32_t k = begin; k < end; ++k) {
        const auto face = static_cast<size_t>(faces_[static_cast<size_t>(k)]);
        for (size_t axis = 0; axis < 3; ++axis) {
            for (const FloatPoint& corner : corners_[face]) {
                lower[axis] = std::min(lower[axis], corner[axis]);
                upper[axis] = std::max(upper[axis], corner[axis]);
            }
            min_centroid[axis] = std::min(min_centroid[axis], centroids[face][axis]);
            max_centroid[axis] = std::max(max_centroid[axis], centroids[face][axis]);
        }
    }
    nodes_.push_back({lower, upper, begin, end - begin});
    if (end - begin <= MAX_LEAF_SIZE) return index;
    size_t widest = 0;
    for (size_t axis = 1; axis < 3; ++axis)
        if (max_centroid[axis] - min_centroid[axis] > max_centroid[widest] - min_centroid[widest]) widest = axis;
    const int32_t half = begin + (end - begin) / 2;
    std::nth_element(faces_.begin() + begin, faces_.begin() + half, faces_.begin() + end, [&](int32_t a, int32_t b) {
        return centroids[static_cast<size_t>(a)][widest] < centroids[static_cast<size_t>(b)][widest];
    });
    build(centroids, begin, half);
    const int32_t second_child = build(centroids, half, end);
    nodes_[static_cast<size_t>(index)].first = second_child;
    nodes_[static_cast<size_t>(index)].count = 0;
    return index;
}

// The face nearest to a point; -1 if none is within the square root of `squared`.
int32_t TriangleBvh::nearest_face(const FloatPoint& point, float squared) const {
    struct Entry {
        int32_t node;
        float squared;
    };
    int32_t nearest = -1;
    Entry stack[STACK_SIZE];
    int size = 0;
    stack[size++] = {0, 0.0f};
    while (size > 0) {
        const Entry entry = stack[--size];
        if (entry.squared > squared) continue;
        const Node* node = &nodes_[static_cast<size_t>(entry.node)];
        while (node->count == 0) {
            const Node *first = node + 1, *second = &nodes_[static_cast<size_t>(node->first)];
            float to_first = squared_distance_to_box(first->lower, first->upper, point);
            float to_second = squared_distance_to_box(second->lower, second->upper, point);
            if (to_second < to_first) {
                std::swap(first, second);
                std::swap(to_first, to_second);
            }
            if (to_second <= squared) stack[size++] = {static_cast<int32_t>(second - nodes_.data()), to_second};
            node = to_first <= squared ? first : nullptr;
            if (!node) break;
        }
        if (!node) continue;
        for (int32_t k = node->first; k < node->first + node->count; ++k) {
            const FloatPoint offset = minus(point, closest_on(corners_[static_cast<size_t>(k)], point));
            const float candidate = dot(offset, offset);
            if (candidate < squared || (nearest < 0 && candidate <= squared)) {
                squared = candidate;
                nearest = faces_[static_cast<size_t>(k)];
            }
        }
    }
    return nearest;
}

TriangleBvh::Nearest TriangleBvh::nearest(const Point& point, double max_distance) const {
    const Point centered = minus(point, center_);
    const FloatPoint rounded{static_cast<float>(centered[0]), static_cast<float>(centered[1]), static_cast<float>(centered[2])};
    const float bound = static_cast<float>(max_distance) * BOUND_FACTOR + rounding_;
    int32_t face = nearest_face(rounded, bound * bound);
    // Search again if the bound was too low. Far away all squared distances overflow; then any face will do.
    if (face < 0) face = std::max(0, nearest_face(rounded, INFINITE));
    const Point closest = closest_on(exact_corners_[static_cast<size_t>(face)], point), offset = minus(point, closest);
    return {std::sqrt(dot(offset, offset)), face, closest};
}

void TriangleBvh::nearest(const double* points, const double* max_distance, int32_t count, double* distance, int64_t* face,
                          double* closest, int threads) const {
    in_parallel(threads, count, CHUNK, [&](int, int32_t begin, int32_t end) {
        for (int64_t i = begin; i < end; ++i) {
            const Point point{points[3 * i], points[3 * i + 1], points[3 * i + 2]};
            const Nearest found = nearest(point, max_distance ? max_distance[i] : INFINITE);
            distance[i] = found.distance;
            face[i] = found.face;
            std::copy(found.closest.begin(), found.closest.end(), closest + 3 * i);
        }
    });
}

}  // namespace surfsup
