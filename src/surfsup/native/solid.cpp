#include "solid.hpp"

#include <stdexcept>

#include "frame.hpp"
#include "network.hpp"
#include "threads.hpp"

namespace surfsup {
namespace {

constexpr int32_t PORTION = 4096;

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
        const auto places = static_cast<int32_t>(parts_.size());
        for (Node node : part->nodes_) {
            node.numbers += first;
            node.parts += places;
            nodes_.push_back(node);
        }
        for (const int32_t place : part->parts_) parts_.push_back(place + nodes);
        numbers_.insert(numbers_.end(), part->numbers_.begin(), part->numbers_.end());
        roots.push_back(static_cast<int32_t>(nodes_.size()) - 1);
    }
    nodes_.push_back({wanted.kind, static_cast<int32_t>(numbers_.size()), given, static_cast<int32_t>(parts_.size()), pieces});
    numbers_.insert(numbers_.end(), numbers.begin(), numbers.end());
    parts_.insert(parts_.end(), roots.begin(), roots.end());
}

void Solid::look(const float* points, int32_t count, float* distance, float* normal, int threads) const {
    static const Path& path = *paths().front();
    const Tree tree{nodes_.data(), numbers_.data(), parts_.data(), static_cast<int32_t>(nodes_.size()) - 1};
    in_parallel(threads, count, PORTION, [&](int, int32_t begin, int32_t end) {
        path.distance(tree, points, begin, end, distance, normal);
    });
}

}  // namespace surfsup
