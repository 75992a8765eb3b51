#include "solid.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "aligned.hpp"
#include "network.hpp"
#include "threads.hpp"

namespace surfsup {
namespace {

// A network or a mesh takes longer than a closed form, so that threads wait less for each other with smaller portions.
constexpr int32_t PORTION = 4096, ASKED_PORTION = 512;
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

// How a part of what lies so within a whole lies in the whole.
Similarity within(const Similarity& whole, const Similarity& part) {
    Similarity both;
    both.scale = whole.scale * part.scale;
    for (int row = 0; row < 3; ++row) {
        both.move[row] = whole.move[row];
        for (int k = 0; k < 3; ++k) both.move[row] += whole.scale * whole.rotation[3 * row + k] * part.move[k];
        for (int column = 0; column < 3; ++column) {
            float& entry = both.rotation[3 * row + column] = 0;
            for (int k = 0; k < 3; ++k) entry += whole.rotation[3 * row + k] * part.rotation[3 * k + column];
        }
    }
    return both;
}

Similarity similarity(const std::vector<float>& numbers) {
    Similarity lies;
    std::copy(numbers.begin(), numbers.begin() + 9, lies.rotation);
    std::copy(numbers.begin() + 9, numbers.begin() + 12, lies.move);
    lies.scale = numbers[12];
    return lies;
}

// Points (count, 3) as seen by what lies so.
void to_own_frame(const Similarity& lies, const float* points, int32_t count, float* own) {
    for (int64_t at = 0; at < 3 * static_cast<int64_t>(count); at += 3)
        for (int column = 0; column < 3; ++column) {
            float along = 0;
            for (int row = 0; row < 3; ++row) along += (points[at + row] - lies.move[row]) * lies.rotation[3 * row + column];
            own[at + column] = along / lies.scale;
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
    const Similarity lies = wanted.kind == Kind::transformed ? similarity(numbers) : Similarity{};
    std::vector<int32_t> roots;
    for (const Solid* part : parts) {
        const auto nodes = static_cast<int32_t>(nodes_.size()), first = static_cast<int32_t>(numbers_.size());
        const auto places = static_cast<int32_t>(parts_.size()), asked = static_cast<int32_t>(asked_.size());
        for (Node node : part->nodes_) {
            node.numbers += first;
            node.parts += node.kind == Kind::asked ? asked : places;
            nodes_.push_back(node);
        }
        for (const int32_t place : part->parts_) parts_.push_back(place + nodes);
        for (const Asked& one : part->asked_) asked_.push_back({one.leaf, within(lies, one.lies)});
        numbers_.insert(numbers_.end(), part->numbers_.begin(), part->numbers_.end());
        roots.push_back(static_cast<int32_t>(nodes_.size()) - 1);
    }
    nodes_.push_back({wanted.kind, static_cast<int32_t>(numbers_.size()), given, static_cast<int32_t>(parts_.size()), pieces});
    numbers_.insert(numbers_.end(), numbers.begin(), numbers.end());
    parts_.insert(parts_.end(), roots.begin(), roots.end());
}

Solid::Solid(std::shared_ptr<const Leaf> leaf) : nodes_{{Kind::asked, 0, 0, 0, 0}}, asked_{{std::move(leaf), {}}} {}

void Solid::look(const float* points, int32_t count, float* distance, float* normal, int threads) const {
    static const Path& path = *paths().front();
    const int64_t room = static_cast<int64_t>(count) + MOST_LANES;
    AlignedFloats rows(static_cast<size_t>(4 * room) * asked_.size());
    std::vector<FieldValues> told;
    for (const Asked& one : asked_) {
        told.push_back({rows.data() + 4 * room * static_cast<int64_t>(told.size()), room, normal != nullptr});
        ask(one, path, points, count, told.back(), threads);
    }
    const Tree tree{nodes_.data(), numbers_.data(), parts_.data(), static_cast<int32_t>(nodes_.size()) - 1, told.data()};
    in_parallel(threads, count, PORTION, [&](int, int32_t begin, int32_t end) {
        path.distance(tree, points, begin, end, distance, normal);
    });
}

void Solid::ask(const Asked& asked, const Path& path, const float* points, int32_t count, const FieldValues& told, int threads) const {
    struct Room {
        AlignedFloats scratch;
        std::vector<int32_t> list;
    };
    std::vector<Room> rooms(static_cast<size_t>(std::max(1, threads)));  // here memory may run out; in the loop not
    for (Room& room : rooms) {
        room.scratch.resize(static_cast<size_t>(asked.leaf->scratch(path)));
        room.list.resize(static_cast<size_t>(std::min(count, ASKED_PORTION)));
    }
    AlignedFloats own(3 * static_cast<size_t>(count));
    in_parallel(threads, count, ASKED_PORTION, [&](int thread, int32_t begin, int32_t end) {
        const int64_t first = 3 * static_cast<int64_t>(begin);
        Room& room = rooms[static_cast<size_t>(thread)];
        to_own_frame(asked.lies, points + first, end - begin, own.data() + first);
        const FieldValues here = {told.rows + begin, told.room, told.with_gradient};
        asked.leaf->ask(path, own.data() + first, end - begin, here, room.list.data(), room.scratch.data());
    });
    std::vector<float> left;
    std::vector<int32_t> which;
    for (int32_t i = 0; i < count; ++i) {
        if (told.rows[i] == told.rows[i]) continue;
        which.push_back(i);
        left.insert(left.end(), own.data() + 3 * static_cast<int64_t>(i), own.data() + 3 * static_cast<int64_t>(i) + 3);
    }
    if (which.empty()) return;
    std::vector<float> distance(which.size(), NO_NUMBER), normal(left.size(), NO_NUMBER);
    asked.leaf->ask_rest(left.data(), static_cast<int32_t>(which.size()), distance.data(), normal.data());
    for (size_t k = 0; k < which.size(); ++k) {
        told.rows[which[k]] = distance[k];
        if (!told.with_gradient) continue;
        for (int64_t axis = 0; axis < 3; ++axis) told.rows[(1 + axis) * told.room + which[k]] = normal[3 * k + static_cast<size_t>(axis)];
    }
}

}  // namespace surfsup
