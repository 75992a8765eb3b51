#include "solid.hpp"

#include <algorithm>
#include <stdexcept>

#include "network.hpp"
#include "threads.hpp"

namespace surfsup {
namespace {

// A network takes longer than a closed form, so that the last thread to be ready waits less for smaller portions.
constexpr int32_t PORTION = 4096, ASKED_PORTION = 512;
constexpr size_t MOST_LANES = 16;

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
        for (const Asked& one : part->asked_) asked_.push_back({one.field, within(lies, one.lies)});
        numbers_.insert(numbers_.end(), part->numbers_.begin(), part->numbers_.end());
        roots.push_back(static_cast<int32_t>(nodes_.size()) - 1);
    }
    nodes_.push_back({wanted.kind, static_cast<int32_t>(numbers_.size()), given, static_cast<int32_t>(parts_.size()), pieces});
    numbers_.insert(numbers_.end(), numbers.begin(), numbers.end());
    parts_.insert(parts_.end(), roots.begin(), roots.end());
}

Solid::Solid(std::shared_ptr<const Field> field) : nodes_{{Kind::asked, 0, 0, 0, 0}}, asked_{{std::move(field), {}}} {}

void Solid::look(const float* points, int32_t count, float* distance, float* normal, int threads) const {
    static const Path& path = *paths().front();
    const int32_t portion = asked_.empty() ? PORTION : ASKED_PORTION, root = static_cast<int32_t>(nodes_.size()) - 1;
    std::vector<Asking> asking = asked_.empty() ? std::vector<Asking>() : std::vector<Asking>(static_cast<size_t>(std::max(1, threads)));
    for (Asking& one : asking) make_room(path, std::min(count, portion), one);  // here memory may run out; in the loop not
    in_parallel(threads, count, portion, [&](int thread, int32_t begin, int32_t end) {
        const int32_t here = end - begin;
        const float* from = points + 3 * static_cast<int64_t>(begin);
        const FieldValues* told = asked_.empty() ? nullptr : ask(path, from, here, normal != nullptr, asking[static_cast<size_t>(thread)]);
        path.distance({nodes_.data(), numbers_.data(), parts_.data(), root, told}, from, here, distance + begin,
                      normal ? normal + 3 * static_cast<int64_t>(begin) : nullptr);
    });
}

void Solid::make_room(const Path& path, int32_t points, Asking& asking) const {
    const auto count = static_cast<size_t>(points), room = count + MOST_LANES;
    asking.own.resize(3 * count), asking.near.resize(count);
    asking.rows.resize(4 * room * asked_.size());
    int64_t scratch = 0;
    for (const Asked& one : asked_) {
        scratch = std::max(scratch, path.field_scratch(*one.field));
        asking.told.push_back({asking.rows.data() + 4 * room * asking.told.size(), static_cast<int64_t>(room), true});
    }
    asking.scratch.resize(static_cast<size_t>(scratch));
}

const FieldValues* Solid::ask(const Path& path, const float* points, int32_t count, bool with_gradient, Asking& asking) const {
    for (size_t k = 0; k < asked_.size(); ++k) {
        asking.told[k].with_gradient = with_gradient;
        to_own_frame(asked_[k].lies, points, count, asking.own.data());
        path.ask_field(*asked_[k].field, asking.own.data(), count, asking.told[k], asking.near.data(), asking.scratch.data());
    }
    return asking.told.data();
}

}  // namespace surfsup
