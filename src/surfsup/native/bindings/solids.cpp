// The face of solids, meshes and maps in Python.
#include <algorithm>
#include <limits>
#include <optional>
#include <tuple>

#include "sdf/mesh.hpp"
#include "bindings/arrays.hpp"
#include "sdf/solid.hpp"
#include "sdf/triangles.hpp"

namespace {

// A network of a solid with its weights, as they are when it is made, and what keeps the memory of its lattice.
struct HeldField {
    std::vector<std::vector<float>> weights;
    std::optional<Fours> table;
    std::vector<surfsup::FieldLayer> layers;
    surfsup::Field field;

    const float* keep(std::vector<float>&& values) {
        weights.push_back(std::move(values));
        return weights.back().data();
    }
    const float* keep(const std::optional<Weight>& weight) {
        return weight ? keep(std::vector<float>(weight->data(), weight->data() + weight->size())) : nullptr;
    }
};

// Of a layer: what the one before is multiplied by, what is told of a place, biases, and what the code is multiplied by.
using GivenLayer = std::tuple<std::optional<Weight>, std::optional<Weight>, std::vector<Values>, std::optional<Weight>>;
using GivenLattice = std::tuple<Fours, std::array<float, 3>, float, std::array<int32_t, 3>>;

surfsup::Lattice lattice_of(const std::optional<GivenLattice>& given) {
    if (!given) return {};
    const auto& [table, lower, cell, nodes] = *given;
    if (std::min({nodes[0], nodes[1], nodes[2]}) < 2 ||
        static_cast<uint64_t>(nodes[0]) * static_cast<uint64_t>(nodes[1]) * static_cast<uint64_t>(nodes[2]) != table.shape(0))
        throw std::invalid_argument("the table is not that of a lattice of so many nodes");
    return {table.data(), {lower[0], lower[1], lower[2]}, cell, {nodes[0], nodes[1], nodes[2]}};
}

// What a layer adds to its sums whatever the place is.
std::vector<float> constants_of(const GivenLayer& layer, const std::optional<Values>& code, size_t width) {
    const auto& [hidden, entering, biases, of_code] = layer;
    std::vector<float> sums(width, 0.0f);
    for (const Values& bias : biases) {
        expect(bias.shape(0), width, "a bias");
        for (size_t k = 0; k < width; ++k) sums[k] += bias.data()[k];
    }
    if (!of_code) return sums;
    if (!code || of_code->shape(0) != width || of_code->shape(1) != code->shape(0)) throw std::invalid_argument("the code does not fit the layers");
    for (size_t k = 0; k < width; ++k)
        for (size_t c = 0; c < code->shape(0); ++c) sums[k] += of_code->data()[k * code->shape(0) + c] * code->data()[c];
    return sums;
}

surfsup::Solid of_network(const std::vector<GivenLayer>& layers, Values last, Values last_bias, const std::optional<Values>& code,
                          float frequency, int octaves, const std::optional<GivenLattice>& lattice, float near) {
    const size_t width = last.shape(0);
    expect(last_bias.shape(0), 1, "last_bias");
    if (width == 0 || layers.empty() || octaves < 0 || octaves > 16) throw std::invalid_argument("a field has layers, and at most 16 octaves come in");
    auto held = std::make_shared<HeldField>();
    if (lattice) held->table = std::get<0>(*lattice);
    for (const GivenLayer& layer : layers) {
        const auto& [hidden, entering, biases, of_code] = layer;
        const bool first = held->layers.empty();
        if (hidden && (hidden->shape(0) != width || hidden->shape(1) != width)) throw std::invalid_argument("a layer is not of the field's width");
        if (entering && (entering->shape(0) != width || entering->shape(1) != static_cast<size_t>(3 + 6 * octaves)))
            throw std::invalid_argument("what enters a layer is not what is told of a place");
        if (first ? hidden || !entering : !hidden) throw std::invalid_argument("into the first layer comes the place, into all others the layer before");
        held->layers.push_back({held->keep(hidden), held->keep(entering), held->keep(constants_of(layer, code, width))});
    }
    const float* last_weights = held->keep(std::vector<float>(last.data(), last.data() + width));
    held->field = {held->layers.data(), static_cast<int>(layers.size()), static_cast<int>(width), octaves, frequency,
                   last_weights, last_bias.data()[0], lattice_of(lattice), near};
    return surfsup::Solid(std::make_shared<surfsup::FieldLeaf>(std::shared_ptr<const surfsup::Field>(held, &held->field)));
}

// A mesh, and what keeps the memory of its grids.
struct HeldMesh {
    nb::object triangles;
    Fours fine, coarse;
    Lengths unsigned_distance;
    Flags inside;
    nb::callable rest;
    surfsup::Mesh mesh;
};

using GivenGrid = std::tuple<Fours, std::array<double, 3>, std::array<double, 3>, double, std::array<int64_t, 3>>;

surfsup::Grid grid_of(const GivenGrid& given) {
    const auto& [table, lower, middle, cell, nodes] = given;
    if (std::min({nodes[0], nodes[1], nodes[2]}) < 2 ||
        static_cast<uint64_t>(nodes[0]) * static_cast<uint64_t>(nodes[1]) * static_cast<uint64_t>(nodes[2]) != table.shape(0))
        throw std::invalid_argument("the table is not that of a grid of so many nodes");
    return {table.data(), lower, middle, cell, nodes};
}

surfsup::Solid of_mesh(const nb::object& triangles, const GivenGrid& fine, const GivenGrid& coarse, Lengths unsigned_distance, Flags inside,
                       double near, double agree, double touching, const nb::callable& rest) {
    expect(unsigned_distance.shape(0), std::get<0>(fine).shape(0), "unsigned_distance");
    expect(inside.shape(0), std::get<0>(fine).shape(0), "inside");
    auto held = std::make_shared<HeldMesh>(HeldMesh{triangles, std::get<0>(fine), std::get<0>(coarse), unsigned_distance, inside, rest, {}});
    const auto ask_rest = [held = held.get()](const float* points, int32_t count, float* distance, float* normal) {
        const nb::gil_scoped_acquire locked;
        const auto rows = static_cast<size_t>(count);
        held->rest(nb::cast(nb::ndarray<nb::numpy, const float>(points, {rows, 3}, nb::handle()), nb::rv_policy::reference),
                   nb::cast(nb::ndarray<nb::numpy, float>(distance, {rows}, nb::handle()), nb::rv_policy::reference),
                   nb::cast(nb::ndarray<nb::numpy, float>(normal, {rows, 3}, nb::handle()), nb::rv_policy::reference));
    };
    held->mesh = {nb::cast<const surfsup::Triangles*>(triangles), grid_of(fine), grid_of(coarse), unsigned_distance.data(), inside.data(),
                  near, agree, touching, ask_rest};
    return surfsup::Solid(std::make_shared<surfsup::MeshLeaf>(std::shared_ptr<const surfsup::Mesh>(held, &held->mesh)));
}

void look(const surfsup::Solid& solid, Vectors points, NewValues distance, std::optional<NewVectors> normal, const std::string& isa,
          int threads) {
    const size_t count = points.shape(0);
    if (count > static_cast<size_t>(std::numeric_limits<int32_t>::max() - 4096))
        throw std::invalid_argument("there are more points than a native solid can count");
    expect(distance.shape(0), count, "distance");
    if (normal) expect(normal->shape(0), count, "normal");
    const surfsup::Isa& chosen = surfsup::isa_of(isa);
    const nb::gil_scoped_release unlocked;
    solid.look(points.data(), static_cast<int32_t>(count), distance.data(), normal ? normal->data() : nullptr, chosen, threads);
}

void make_triangles(surfsup::Triangles* triangles, Points vertices, Faces faces) {
    new (triangles) surfsup::Triangles(vertices.data(), static_cast<int64_t>(vertices.shape(0)), faces.data(),
                                       static_cast<int64_t>(faces.shape(0)));
}

int32_t count_of(const Points& points) {
    if (points.shape(0) > static_cast<size_t>(std::numeric_limits<int32_t>::max() - 4096))
        throw std::invalid_argument("there are more points than can be counted");
    return static_cast<int32_t>(points.shape(0));
}

void nearest(const surfsup::Triangles& triangles, Points points, std::optional<Lengths> at_most, NewLengths distance,
             NewIndices face, NewPoints closest, int threads) {
    const int32_t count = count_of(points);
    if (at_most) expect(at_most->shape(0), points.shape(0), "at_most");
    expect(distance.shape(0), points.shape(0), "distance");
    expect(face.shape(0), points.shape(0), "face");
    expect(closest.shape(0), points.shape(0), "closest");
    const nb::gil_scoped_release unlocked;
    triangles.nearest(points.data(), at_most ? at_most->data() : nullptr, count, distance.data(), face.data(),
                      closest.data(), threads);
}

void sample(const GivenGrid& given, Points points, NewLengths distance, NewPoints gradient, int threads) {
    const int32_t count = count_of(points);
    expect(distance.shape(0), points.shape(0), "distance");
    expect(gradient.shape(0), points.shape(0), "gradient");
    const surfsup::Grid grid = grid_of(given);
    const nb::gil_scoped_release unlocked;
    surfsup::sample(grid, points.data(), count, distance.data(), gradient.data(), threads);
}

}  // namespace

surfsup::SolidQuery solid_query(const nb::object& solid, const surfsup::Isa& isa, int threads) {
    if (solid.is_none()) return {};
    if (const surfsup::Solid* known; nb::try_cast(solid, known))
        return [known, &isa, threads](float* points, int32_t count, float* distance, float* normal) {
            known->look(points, count, distance, normal, isa, threads);
        };
    return [&solid](float* points, int32_t count, float* distance, float* normal) {
        const nb::gil_scoped_acquire locked;
        const auto rows = static_cast<size_t>(count);
        const auto given = nb::cast(nb::ndarray<nb::numpy, float>(points, {rows, 3}, nb::handle()), nb::rv_policy::reference);
        const auto lengths = nb::cast(nb::ndarray<nb::numpy, float>(distance, {rows}, nb::handle()), nb::rv_policy::reference);
        if (normal)
            solid(given, lengths, nb::cast(nb::ndarray<nb::numpy, float>(normal, {rows, 3}, nb::handle()), nb::rv_policy::reference));
        else
            solid(given, lengths, nb::none());
    };
}

void add_solids(nb::module_& module) {
    module.def("sample", sample, "grid"_a, array("points"), array("distance"), array("gradient"), "threads"_a);
    nb::class_<surfsup::Triangles>(module, "Triangles")
        .def("__init__", make_triangles, array("vertices"), array("faces"))
        .def("nearest", nearest, array("points"), array("at_most").none(), array("distance"), array("face"),
             array("closest"), "threads"_a);
    nb::class_<surfsup::Solid>(module, "Solid")
        .def(nb::init<const std::string&, const std::vector<float>&, const std::vector<const surfsup::Solid*>&>(), "kind"_a,
             "numbers"_a, "parts"_a)
        .def_static("of_network", of_network, nb::kw_only(), "layers"_a, array("last"), array("last_bias"), array("code").none(),
                    "frequency"_a, "octaves"_a, "lattice"_a.none(), "near"_a)
        .def_static("of_mesh", of_mesh, nb::kw_only(), "triangles"_a, "fine"_a, "coarse"_a, array("unsigned_distance"), array("inside"),
                    "near"_a, "agree"_a, "touching"_a, "rest"_a)
        .def("look", look, array("points"), array("distance"), array("normal").none(), "isa"_a, "threads"_a);
}
