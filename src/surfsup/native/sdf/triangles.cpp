#include "sdf/triangles.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

#include "runtime/threads.hpp"

namespace surfsup {
namespace {

constexpr int32_t LEAF = 8;        // triangles in a leaf, at most
constexpr int32_t PORTION = 256;   // points
constexpr float LOOSER = 1.00001f;  // a bound met exactly must not hide the triangle that meets it
constexpr int DEEPEST = 64;        // of a tree that halves 2^31 triangles until a leaf is left: 30, and the other halves

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

// The place on a triangle nearest to a point (C. Ericson, "Real-Time Collision Detection", 2005, section 5.1.5). An edge
// whose ends are one is passed over, so that a triangle that is a segment or a point has its nearest place, too.
template <typename Vector>
Vector nearest_on(const std::array<Vector, 3>& triangle, const Vector& point) {
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
        const Number share = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return plus(b, share, minus(c, b), Number(0), ac);
    }
    const Number whole = va + vb + vc;
    return whole > 0 ? plus(a, vb / whole, ab, vc / whole, ac) : a;  // else a triangle without area
}

float squared_to_box(const Place& lower, const Place& upper, const Place& place) {
    float squared = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
        const float beyond = std::max(0.0f, std::max(lower[axis] - place[axis], place[axis] - upper[axis]));
        squared += beyond * beyond;
    }
    return squared;
}

constexpr float ENDLESS = std::numeric_limits<float>::infinity();

}  // namespace

Triangles::Triangles(const double* vertices, int64_t vertex_count, const int64_t* faces, int64_t face_count) {
    if (face_count < 1 || face_count > std::numeric_limits<int32_t>::max() / 2)
        throw std::out_of_range("there are no triangles, or more than can be counted");
    const auto count = static_cast<size_t>(face_count);
    Point lower, upper;
    lower.fill(std::numeric_limits<double>::infinity());
    upper.fill(-std::numeric_limits<double>::infinity());
    exact_.resize(count);
    for (size_t face = 0; face < count; ++face)
        for (size_t corner = 0; corner < 3; ++corner) {
            const int64_t vertex = faces[3 * face + corner];
            if (vertex < 0 || vertex >= vertex_count) throw std::out_of_range("a face has a corner that there is not");
            for (size_t axis = 0; axis < 3; ++axis) {
                const double value = vertices[3 * vertex + static_cast<int64_t>(axis)];
                exact_[face][corner][axis] = value;
                lower[axis] = std::min(lower[axis], value);
                upper[axis] = std::max(upper[axis], value);
            }
        }
    double extent = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
        middle_[axis] = (lower[axis] + upper[axis]) / 2;
        extent = std::max(extent, upper[axis] - lower[axis]);
    }
    rounding_ = static_cast<float>(1e-6 * extent);
    std::vector<std::array<Place, 3>> corners(count);
    std::vector<Place> middles(count);
    for (size_t face = 0; face < count; ++face)
        for (size_t axis = 0; axis < 3; ++axis) {
            middles[face][axis] = 0;
            for (size_t corner = 0; corner < 3; ++corner) {
                corners[face][corner][axis] = static_cast<float>(exact_[face][corner][axis] - middle_[axis]);
                middles[face][axis] += corners[face][corner][axis] / 3;
            }
        }
    corners_ = corners;
    faces_.resize(count);
    std::iota(faces_.begin(), faces_.end(), 0);
    nodes_.reserve(count);
    build(middles, 0, static_cast<int32_t>(count));
    for (size_t place = 0; place < count; ++place) corners_[place] = corners[static_cast<size_t>(faces_[place])];
}

int32_t Triangles::build(const std::vector<Place>& middles, int32_t begin, int32_t end) {
    const auto number = static_cast<int32_t>(nodes_.size());
    Place lower{ENDLESS, ENDLESS, ENDLESS}, upper{-ENDLESS, -ENDLESS, -ENDLESS}, least = lower, most = upper;
    for (int32_t place = begin; place < end; ++place) {
        const auto face = static_cast<size_t>(faces_[static_cast<size_t>(place)]);
        for (size_t axis = 0; axis < 3; ++axis) {
            for (const Place& corner : corners_[face]) {
                lower[axis] = std::min(lower[axis], corner[axis]);
                upper[axis] = std::max(upper[axis], corner[axis]);
            }
            least[axis] = std::min(least[axis], middles[face][axis]);
            most[axis] = std::max(most[axis], middles[face][axis]);
        }
    }
    nodes_.push_back({lower, upper, begin, end - begin});
    if (end - begin <= LEAF) return number;
    size_t widest = 0;
    for (size_t axis = 1; axis < 3; ++axis)
        if (most[axis] - least[axis] > most[widest] - least[widest]) widest = axis;
    const int32_t half = begin + (end - begin) / 2;
    std::nth_element(faces_.begin() + begin, faces_.begin() + half, faces_.begin() + end, [&](int32_t one, int32_t other) {
        return middles[static_cast<size_t>(one)][widest] < middles[static_cast<size_t>(other)][widest];
    });
    build(middles, begin, half);
    const int32_t second = build(middles, half, end);
    nodes_[static_cast<size_t>(number)].first = second;
    nodes_[static_cast<size_t>(number)].count = 0;
    return number;
}

// The face nearest to a place, -1 where none is within the root of `squared`.
int32_t Triangles::nearest_face(const Place& place, float squared) const {
    struct Waiting {
        int32_t node;
        float squared;
    };
    int32_t found = -1;
    Waiting waiting[DEEPEST];
    int size = 0;
    waiting[size++] = {0, 0.0f};
    while (size > 0) {
        const Waiting now = waiting[--size];
        if (now.squared > squared) continue;
        const Node* node = &nodes_[static_cast<size_t>(now.node)];
        while (node->count == 0) {
            const Node *first = node + 1, *second = &nodes_[static_cast<size_t>(node->first)];
            float to_first = squared_to_box(first->lower, first->upper, place);
            float to_second = squared_to_box(second->lower, second->upper, place);
            if (to_second < to_first) {
                std::swap(first, second);
                std::swap(to_first, to_second);
            }
            if (to_second <= squared) waiting[size++] = {static_cast<int32_t>(second - nodes_.data()), to_second};
            node = to_first <= squared ? first : nullptr;
            if (!node) break;
        }
        if (!node) continue;
        for (int32_t k = node->first; k < node->first + node->count; ++k) {
            const Place apart = minus(place, nearest_on(corners_[static_cast<size_t>(k)], place));
            const float here = dot(apart, apart);
            if (here < squared || (found < 0 && here <= squared)) {
                squared = here;
                found = faces_[static_cast<size_t>(k)];
            }
        }
    }
    return found;
}

Triangles::Nearest Triangles::nearest(const Point& point, double at_most) const {
    const Point from_middle = minus(point, middle_);
    const Place place{static_cast<float>(from_middle[0]), static_cast<float>(from_middle[1]), static_cast<float>(from_middle[2])};
    const float bound = static_cast<float>(at_most) * LOOSER + rounding_;
    int32_t found = nearest_face(place, bound * bound);
    // None where a bound was too low after all; and from far away all distances overflow alike.
    if (found < 0) found = std::max(0, nearest_face(place, ENDLESS));
    const Point there = nearest_on(exact_[static_cast<size_t>(found)], point), apart = minus(point, there);
    return {std::sqrt(dot(apart, apart)), found, there};
}

void Triangles::nearest(const double* points, const double* at_most, int32_t count, double* distance, int64_t* face,
                        double* closest, int threads) const {
    in_parallel(threads, count, PORTION, [&](int, int32_t begin, int32_t end) {
        for (int64_t i = begin; i < end; ++i) {
            const Nearest found = nearest({points[3 * i], points[3 * i + 1], points[3 * i + 2]}, at_most ? at_most[i] : ENDLESS);
            distance[i] = found.distance;
            face[i] = found.face;
            std::copy(found.place.begin(), found.place.end(), closest + 3 * i);
        }
    });
}

double sample(const Grid& grid, const Point& point, Point& gradient) {
    const int64_t along_y = grid.nodes[2], along_x = grid.nodes[1] * grid.nodes[2];
    int64_t first[3];
    float share[3][2];
    for (size_t axis = 0; axis < 3; ++axis) {
        const double place = (point[axis] - grid.lower[axis]) / grid.cell;
        first[axis] = std::clamp<int64_t>(static_cast<int64_t>(place), 0, grid.nodes[axis] - 2);
        share[axis][1] = static_cast<float>(place - static_cast<double>(first[axis]));
        share[axis][0] = 1.0f - share[axis][1];
    }
    const float* corner = grid.table + 4 * (first[0] * along_x + first[1] * along_y + first[2]);
    float mean[4] = {};
    for (int x = 0; x < 2; ++x)
        for (int y = 0; y < 2; ++y)
            for (int z = 0; z < 2; ++z) {
                const float weight = share[0][x] * share[1][y] * share[2][z];
                const float* node = corner + 4 * (x * along_x + y * along_y + z);
                for (int channel = 0; channel < 4; ++channel) mean[channel] += weight * node[channel];
            }
    double told = mean[0];
    for (size_t axis = 0; axis < 3; ++axis) {
        gradient[axis] = mean[1 + axis];
        told += 0.5 * (point[axis] - grid.middle[axis]) * gradient[axis];
    }
    return told;
}

void sample(const Grid& grid, const double* points, int32_t count, double* distance, double* gradient, int threads) {
    in_parallel(threads, count, PORTION, [&](int, int32_t begin, int32_t end) {
        for (int64_t i = begin; i < end; ++i) {
            Point slope;
            distance[i] = sample(grid, {points[3 * i], points[3 * i + 1], points[3 * i + 2]}, slope);
            std::copy(slope.begin(), slope.end(), gradient + 3 * i);
        }
    });
}

}  // namespace surfsup
