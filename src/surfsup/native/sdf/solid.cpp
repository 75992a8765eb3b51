#include "sdf/solid.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "runtime/aligned.hpp"
#include "runtime/threads.hpp"

namespace surfsup {
namespace {

// A network or a mesh takes longer than a closed form, so that threads wait less for each other with smaller portions.
constexpr int32_t PORTION = 4096, LEAF_PORTION = 512;
constexpr int64_t MOST_LANES = 16;
constexpr float NO_NUMBER = std::numeric_limits<float>::quiet_NaN();

struct Description {
    const char* name;
    Kind kind;
    int numbers, parts;  // -1: any positive multiple of BOX, any positive number
};

constexpr int BOX = 15;

constexpr Description KINDS[] = {
    {"sphere", Kind::sphere, 1, 0},  {"box", Kind::box, 3, 0},       {"cylinder", Kind::cylinder, 2, 0},
    {"cone", Kind::cone, 3, 0},      {"torus", Kind::torus, 2, 0},   {"bowl", Kind::bowl, 3, 0},
    {"funnel", Kind::funnel, 5, 0},  {"boxes", Kind::boxes, -1, 0},  {"transformed", Kind::transformed, 13, 1},
    {"union", Kind::join, 0, -1},    {"intersection", Kind::meet, 0, -1}, {"difference", Kind::difference, 0, 2},
};

const Description& description(const std::string& name) {
    for (const Description& one : KINDS)
        if (name == one.name) return one;
    throw std::invalid_argument("there is no native solid '" + name + "'");
}

Similarity similarity(const std::vector<float>& numbers) {
    Similarity lies;
    std::copy(numbers.begin(), numbers.begin() + 9, lies.rotation);
    std::copy(numbers.begin() + 9, numbers.begin() + 12, lies.move);
    lies.scale = numbers[12];
    return lies;
}

// Points (count, 3) as seen by what lies so; in place.
void to_own_frame(const Similarity& lies, float* points, int32_t count) {
    for (int64_t at = 0; at < 3 * static_cast<int64_t>(count); at += 3) {
        const float x = points[at] - lies.move[0], y = points[at + 1] - lies.move[1], z = points[at + 2] - lies.move[2];
        for (int axis = 0; axis < 3; ++axis)
            points[at + axis] = (x * lies.rotation[axis] + y * lies.rotation[3 + axis] + z * lies.rotation[6 + axis]) / lies.scale;
    }
}

}  // namespace

Solid::Solid(const std::string& kind, const std::vector<float>& numbers, const std::vector<const Solid*>& parts) {
    const Description& wanted = description(kind);
    const auto given = static_cast<int>(numbers.size()), pieces = static_cast<int>(parts.size());
    const bool right_numbers = wanted.numbers < 0 ? given > 0 && given % BOX == 0 : given == wanted.numbers;
    if (!right_numbers || (wanted.parts < 0 ? pieces == 0 : pieces != wanted.parts))
        throw std::invalid_argument("a native '" + kind + "' is not made of " + std::to_string(given) + " numbers and " +
                                    std::to_string(pieces) + " parts");
    std::vector<int32_t> roots;
    for (const Solid* part : parts) {
        const auto nodes = static_cast<int32_t>(nodes_.size()), first = static_cast<int32_t>(numbers_.size());
        const auto places = static_cast<int32_t>(parts_.size()), leaves = static_cast<int32_t>(leaves_.size());
        for (Node node : part->nodes_) {
            node.numbers += first;
            node.parts += node.kind == Kind::leaf ? leaves : places;
            nodes_.push_back(node);
        }
        for (const int32_t place : part->parts_) parts_.push_back(place + nodes);
        for (Placed placed : part->leaves_) {
            if (wanted.kind == Kind::transformed) placed.lies.insert(placed.lies.begin(), similarity(numbers));
            leaves_.push_back(std::move(placed));
        }
        numbers_.insert(numbers_.end(), part->numbers_.begin(), part->numbers_.end());
        roots.push_back(static_cast<int32_t>(nodes_.size()) - 1);
    }
    nodes_.push_back({wanted.kind, static_cast<int32_t>(numbers_.size()), given, static_cast<int32_t>(parts_.size()), pieces});
    numbers_.insert(numbers_.end(), numbers.begin(), numbers.end());
    parts_.insert(parts_.end(), roots.begin(), roots.end());
}

Solid::Solid(std::shared_ptr<const Leaf> leaf) : nodes_{{Kind::leaf, 0, 0, 0, 0}}, leaves_{{std::move(leaf), {}}} {}

void Solid::look(const float* points, int32_t count, float* distance, float* normal, const Isa& isa, int threads) const {
    const int64_t room = static_cast<int64_t>(count) + MOST_LANES;
    AlignedFloats rows(static_cast<size_t>(4 * room) * leaves_.size());
    std::vector<LeafLook> looks;
    for (const Placed& placed : leaves_) {
        looks.push_back({rows.data() + 4 * room * static_cast<int64_t>(looks.size()), room, normal != nullptr});
        look_at(placed, isa, points, count, looks.back(), threads);
    }
    const Tree tree{nodes_.data(), numbers_.data(), parts_.data(), static_cast<int32_t>(nodes_.size()) - 1, looks.data()};
    in_parallel(threads, count, PORTION, [&](int, int32_t begin, int32_t end) {
        isa.distance(tree, points, begin, end, distance, normal);
    });
}

void Solid::look_at(const Placed& placed, const Isa& isa, const float* points, int32_t count, const LeafLook& to, int threads) const {
    struct Room {
        AlignedFloats scratch;
        std::vector<int32_t> list;
    };
    std::vector<Room> rooms(static_cast<size_t>(std::max(1, threads)));  // here memory may run out; in the loop not
    for (Room& room : rooms) {
        room.scratch.resize(static_cast<size_t>(placed.leaf->scratch(isa)));
        room.list.resize(static_cast<size_t>(std::min(count, LEAF_PORTION)));
    }
    AlignedFloats own(points, points + 3 * static_cast<int64_t>(count));
    in_parallel(threads, count, LEAF_PORTION, [&](int thread, int32_t begin, int32_t end) {
        float* from = own.data() + 3 * static_cast<int64_t>(begin);
        Room& room = rooms[static_cast<size_t>(thread)];
        for (const Similarity& lies : placed.lies) to_own_frame(lies, from, end - begin);
        placed.leaf->look(isa, from, end - begin, {to.rows + begin, to.room, to.with_normal}, room.list.data(), room.scratch.data());
    });
    std::vector<float> left;
    std::vector<int32_t> which;
    for (int32_t i = 0; i < count; ++i) {
        if (to.rows[i] == to.rows[i]) continue;
        which.push_back(i);
        left.insert(left.end(), own.data() + 3 * static_cast<int64_t>(i), own.data() + 3 * static_cast<int64_t>(i) + 3);
    }
    if (which.empty()) return;
    std::vector<float> distance(which.size(), NO_NUMBER), normal(left.size(), NO_NUMBER);
    placed.leaf->look_at_rest(left.data(), static_cast<int32_t>(which.size()), distance.data(), normal.data());
    for (size_t k = 0; k < which.size(); ++k) {
        to.rows[which[k]] = distance[k];
        if (!to.with_normal) continue;
        for (int64_t axis = 0; axis < 3; ++axis) to.rows[(1 + axis) * to.room + which[k]] = normal[3 * k + static_cast<size_t>(axis)];
    }
}

}  // namespace surfsup
