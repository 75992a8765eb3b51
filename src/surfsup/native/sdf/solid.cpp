#include "sdf/solid.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "runtime/aligned.hpp"
#include "runtime/threads.hpp"

namespace surfsup {
namespace {

// Points per task of a thread. Networks and meshes take longer per point than closed forms, so that smaller chunks balance
// better.
constexpr int32_t CHUNK = 4096, SAMPLED_CHUNK = 512;
constexpr int64_t MAX_LANES = 16;
constexpr float NOT_A_NUMBER = std::numeric_limits<float>::quiet_NaN();
constexpr int MAX_DEPTH = 1000;     // of nested solids: they are evaluated recursively
constexpr int BOX_PARAMETERS = 15;  // size, rotation, center

struct KindDescription {
    const char* name;
    Kind kind;
    int parameters, parts;  // -1: any positive multiple of BOX_PARAMETERS, any positive number
};

constexpr KindDescription KINDS[] = {
    {"sphere", Kind::sphere, 1, 0},
    {"box", Kind::box, 3, 0},
    {"cylinder", Kind::cylinder, 2, 0},
    {"cone", Kind::cone, 3, 0},
    {"torus", Kind::torus, 2, 0},
    {"bowl", Kind::bowl, 3, 0},
    {"funnel", Kind::funnel, 5, 0},
    {"boxes", Kind::boxes, -1, 0},
    {"transformed", Kind::transformed, 13, 1},
    {"offset", Kind::offset, 1, 1},
    {"union", Kind::set_union, 0, -1},
    {"intersection", Kind::intersection, 0, -1},
    {"difference", Kind::difference, 0, 2},
    {"complement", Kind::complement, 0, 1},
    {"edged_intersection", Kind::edged_intersection, 0, -1},
};

const KindDescription& description(const std::string& name) {
    for (const KindDescription& candidate : KINDS)
        if (name == candidate.name) return candidate;
    throw std::invalid_argument("there is no native solid '" + name + "'");
}

Similarity similarity(const std::vector<float>& parameters) {
    Similarity transform;
    std::copy(parameters.begin(), parameters.begin() + 9, transform.rotation);
    std::copy(parameters.begin() + 9, parameters.begin() + 12, transform.translation);
    transform.scale = parameters[12];
    return transform;
}

// Applies the inverse of `transform` to points (count, 3) in place.
void to_own_frame(const Similarity& transform, float* points, int32_t count) {
    const float *move = transform.translation, *rotation = transform.rotation;
    for (int64_t at = 0; at < 3 * static_cast<int64_t>(count); at += 3) {
        const float x = points[at] - move[0], y = points[at + 1] - move[1], z = points[at + 2] - move[2];
        for (int axis = 0; axis < 3; ++axis)
            points[at + axis] = (x * rotation[axis] + y * rotation[3 + axis] + z * rotation[6 + axis]) / transform.scale;
    }
}

}  // namespace

Solid::Solid(const std::string& kind, const std::vector<float>& parameters, const std::vector<const Solid*>& parts) {
    const KindDescription& expected = description(kind);
    const auto parameter_count = static_cast<int>(parameters.size()), part_count = static_cast<int>(parts.size());
    const bool right_parameters = expected.parameters < 0 ? parameter_count > 0 && parameter_count % BOX_PARAMETERS == 0
                                                          : parameter_count == expected.parameters;
    if (!right_parameters || (expected.parts < 0 ? part_count == 0 : part_count != expected.parts))
        throw std::invalid_argument("a native '" + kind + "' cannot have " + std::to_string(parameter_count) +
                                    " parameters and " + std::to_string(part_count) + " parts");
    for (const Solid* part : parts) depth_ = std::max(depth_, part->depth_ + 1);
    if (depth_ > MAX_DEPTH) throw std::invalid_argument("solids are nested too deeply");
    std::vector<int32_t> roots;
    for (const Solid* part : parts) {
        const auto first_node = static_cast<int32_t>(nodes_.size()), first_parameter = static_cast<int32_t>(parameters_.size());
        const auto first_part = static_cast<int32_t>(parts_.size()), first_shape = static_cast<int32_t>(shapes_.size());
        for (CsgNode node : part->nodes_) {
            node.parameters += first_parameter;
            node.parts += node.kind == Kind::sampled ? first_shape : first_part;
            nodes_.push_back(node);
        }
        for (const int32_t index : part->parts_) parts_.push_back(index + first_node);
        for (PlacedShape placed : part->shapes_) {
            if (expected.kind == Kind::transformed) placed.transforms.insert(placed.transforms.begin(), similarity(parameters));
            shapes_.push_back(std::move(placed));
        }
        parameters_.insert(parameters_.end(), part->parameters_.begin(), part->parameters_.end());
        roots.push_back(static_cast<int32_t>(nodes_.size()) - 1);
    }
    nodes_.push_back({expected.kind, static_cast<int32_t>(parameters_.size()), parameter_count,
                      static_cast<int32_t>(parts_.size()), part_count});
    parameters_.insert(parameters_.end(), parameters.begin(), parameters.end());
    parts_.insert(parts_.end(), roots.begin(), roots.end());
}

Solid::Solid(std::shared_ptr<const SampledShape> shape)
    : nodes_{{Kind::sampled, 0, 0, 0, 0}}, shapes_{{std::move(shape), {}}} {}

void Solid::evaluate(const float* points, int32_t count, float* distance, float* normal, const Isa& isa, int threads) const {
    const int64_t stride = static_cast<int64_t>(count) + MAX_LANES;  // vectors may extend beyond the last point
    AlignedFloats rows(static_cast<size_t>(4 * stride) * shapes_.size());
    const bool with_normal = normal || std::any_of(nodes_.begin(), nodes_.end(),
                                                   [](const CsgNode& node) { return node.kind == Kind::edged_intersection; });
    std::vector<Samples> samples;
    for (const PlacedShape& placed : shapes_) {
        samples.push_back({rows.data() + 4 * stride * static_cast<int64_t>(samples.size()), stride, with_normal});
        sample(placed, isa, points, count, samples.back(), threads);
    }
    const CsgTree tree{nodes_.data(), parameters_.data(), parts_.data(), static_cast<int32_t>(nodes_.size()) - 1,
                       samples.data()};
    in_parallel(threads, count, CHUNK,
                [&](int, int32_t begin, int32_t end) { isa.sdf->evaluate_tree(tree, points, begin, end, distance, normal); });
}

void Solid::sample(const PlacedShape& placed, const Isa& isa, const float* points, int32_t count, const Samples& samples,
                   int threads) const {
    struct Workspace {
        AlignedFloats scratch;
        std::vector<int32_t> indices;
    };
    std::vector<Workspace> workspaces(static_cast<size_t>(std::max(1, threads)));  // allocate here: threads must not throw
    for (Workspace& workspace : workspaces) {
        workspace.scratch.resize(static_cast<size_t>(placed.shape->scratch_size(isa)));
        workspace.indices.resize(static_cast<size_t>(std::min(count, SAMPLED_CHUNK)));
    }
    AlignedFloats own(points, points + 3 * static_cast<int64_t>(count));
    in_parallel(threads, count, SAMPLED_CHUNK, [&](int thread, int32_t begin, int32_t end) {
        float* from = own.data() + 3 * static_cast<int64_t>(begin);
        Workspace& workspace = workspaces[static_cast<size_t>(thread)];
        for (const Similarity& transform : placed.transforms) to_own_frame(transform, from, end - begin);
        placed.shape->sample(isa, from, end - begin, {samples.rows + begin, samples.stride, samples.with_normal},
                             workspace.indices.data(), workspace.scratch.data());
    });
    std::vector<float> undecided;
    std::vector<int32_t> indices;
    for (int32_t i = 0; i < count; ++i) {
        if (samples.rows[i] == samples.rows[i]) continue;
        indices.push_back(i);
        undecided.insert(undecided.end(), own.data() + 3 * static_cast<int64_t>(i),
                         own.data() + 3 * static_cast<int64_t>(i) + 3);
    }
    if (indices.empty()) return;
    std::vector<float> distance(indices.size(), NOT_A_NUMBER), normal(undecided.size(), NOT_A_NUMBER);
    placed.shape->sample_undecided(undecided.data(), static_cast<int32_t>(indices.size()), distance.data(), normal.data());
    for (size_t k = 0; k < indices.size(); ++k) {
        samples.rows[indices[k]] = distance[k];
        if (!samples.with_normal) continue;
        for (int64_t axis = 0; axis < 3; ++axis)
            samples.rows[(1 + axis) * samples.stride + indices[k]] = normal[3 * k + static_cast<size_t>(axis)];
    }
}

}  // namespace surfsup
