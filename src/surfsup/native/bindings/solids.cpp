// Python bindings of solids, triangle meshes and grids.
#include <algorithm>
#include <limits>
#include <optional>
#include <tuple>

#include "bindings/arrays.hpp"
#include "sdf/mesh_shape.hpp"
#include "sdf/solid.hpp"
#include "sdf/triangle_bvh.hpp"

namespace {

// Weights of the previous activations, weights of the inputs, biases, weights of the code.
using Layer = std::tuple<std::optional<Weight>, std::optional<Weight>, std::vector<Values>, std::optional<Weight>>;

// Table, first node, center, cell, nodes along each axis.
using Grid = std::tuple<Fours, std::array<double, 3>, std::array<double, 3>, double, std::array<int64_t, 3>>;

// A neural field, a copy of its weights, and a reference to the table of its grid.
struct OwnedField {
    std::vector<std::vector<float>> weights;
    std::optional<Fours> table;
    std::vector<surfsup::NeuralLayer> layers;
    surfsup::NeuralField field;

    const float* copy(std::vector<float>&& values) {
        weights.push_back(std::move(values));
        return weights.back().data();
    }
    const float* copy(const std::optional<Weight>& weight) {
        return weight ? copy(std::vector<float>(weight->data(), weight->data() + weight->size())) : nullptr;
    }
};

// A mesh and references to the memory that it uses.
struct OwnedMesh {
    nb::object bvh;
    Fours fine_table, coarse_table;
    Lengths node_distance;
    nb::callable query_undecided;
    surfsup::MeshDistance mesh;
};

template <typename Real>
surfsup::SdfGrid<Real> make_grid(const Grid& grid) {
    const auto& [table, lower, center, cell, nodes] = grid;
    if (std::min({nodes[0], nodes[1], nodes[2]}) < 2 || product_of(nodes.data()) != static_cast<int64_t>(table.shape(0)))
        throw std::invalid_argument("the table of a grid does not have one row per node");
    surfsup::SdfGrid<Real> made{};
    made.table = table.data();
    made.cell = static_cast<Real>(cell);
    if (!(made.cell > 0)) throw std::invalid_argument("the cells of a grid must have a size");
    for (size_t axis = 0; axis < 3; ++axis) {
        made.lower[axis] = static_cast<Real>(lower[axis]);
        made.center[axis] = static_cast<Real>(center[axis]);
        made.nodes[axis] = nodes[axis];
    }
    return made;
}

// The part of a layer's argument that is the same at all points: biases and code.
std::vector<float> constant_part(const Layer& layer, const std::optional<Values>& code, size_t width) {
    const auto& [hidden, input, biases, code_weights] = layer;
    std::vector<float> sums(width, 0.0f);
    for (const Values& bias : biases) {
        expect(bias.shape(0), width, "a bias");
        for (size_t k = 0; k < width; ++k) sums[k] += bias.data()[k];
    }
    if (!code_weights) return sums;
    if (!code || code_weights->shape(0) != width || code_weights->shape(1) != code->shape(0))
        throw std::invalid_argument("the code does not match the layers");
    for (size_t k = 0; k < width; ++k)
        for (size_t c = 0; c < code->shape(0); ++c) sums[k] += code_weights->data()[k * code->shape(0) + c] * code->data()[c];
    return sums;
}

surfsup::Solid of_network(const std::vector<Layer>& layers, Values last, Values last_bias, const std::optional<Values>& code,
                          float frequency, int octaves, const std::optional<Grid>& grid, float network_range) {
    const size_t width = last.shape(0);
    expect(last_bias.shape(0), 1, "last_bias");
    if (width == 0 || layers.empty() || octaves < 0 || octaves > 16)
        throw std::invalid_argument("a network needs layers, channels and at most 16 octaves");
    auto owned = std::make_shared<OwnedField>();
    if (grid) owned->table = std::get<0>(*grid);
    for (const Layer& layer : layers) {
        const auto& [hidden, input, biases, code_weights] = layer;
        const bool first = owned->layers.empty();
        if (hidden && (hidden->shape(0) != width || hidden->shape(1) != width))
            throw std::invalid_argument("a layer does not have the width of the network");
        if (input && (input->shape(0) != width || input->shape(1) != static_cast<size_t>(3 + 6 * octaves)))
            throw std::invalid_argument("the weights of a layer do not match the inputs");
        if (first ? hidden || !input : !hidden)
            throw std::invalid_argument("the first layer needs inputs only, and every other layer the previous one");
        owned->layers.push_back({owned->copy(hidden), owned->copy(input), owned->copy(constant_part(layer, code, width))});
    }
    const float* last_weights = owned->copy(std::vector<float>(last.data(), last.data() + width));
    owned->field = {owned->layers.data(),
                    static_cast<int>(layers.size()),
                    static_cast<int>(width),
                    octaves,
                    frequency,
                    last_weights,
                    last_bias.data()[0],
                    grid ? make_grid<float>(*grid) : surfsup::SdfGrid<float>{},
                    network_range};
    return surfsup::Solid(
        std::make_shared<surfsup::NeuralShape>(std::shared_ptr<const surfsup::NeuralField>(owned, &owned->field)));
}

auto as_array(float* data, size_t rows) {
    return nb::cast(nb::ndarray<nb::numpy, float>(data, {rows}, nb::handle()), nb::rv_policy::reference);
}

template <typename Value>
auto as_vectors(Value* data, size_t rows) {
    return nb::cast(nb::ndarray<nb::numpy, Value>(data, {rows, 3}, nb::handle()), nb::rv_policy::reference);
}

surfsup::Solid of_mesh(const nb::object& bvh, const Grid& fine, const Grid& coarse, Lengths node_distance, double mesh_range,
                       double min_agreement, double on_surface, const nb::callable& query_undecided) {
    expect(node_distance.shape(0), std::get<0>(fine).shape(0), "node_distance");
    auto owned =
        std::make_shared<OwnedMesh>(OwnedMesh{bvh, std::get<0>(fine), std::get<0>(coarse), node_distance, query_undecided, {}});
    const auto query = [owned = owned.get()](const float* points, int32_t count, float* distance, float* normal) {
        const nb::gil_scoped_acquire locked;
        const auto rows = static_cast<size_t>(count);
        owned->query_undecided(as_vectors(points, rows), as_array(distance, rows), as_vectors(normal, rows));
    };
    owned->mesh = {nb::cast<const surfsup::TriangleBvh*>(bvh),
                   make_grid<double>(fine),
                   make_grid<double>(coarse),
                   node_distance.data(),
                   mesh_range,
                   min_agreement,
                   on_surface,
                   query};
    return surfsup::Solid(
        std::make_shared<surfsup::MeshShape>(std::shared_ptr<const surfsup::MeshDistance>(owned, &owned->mesh)));
}

template <typename Array>
int32_t count_of(const Array& points) {
    if (points.shape(0) > static_cast<size_t>(std::numeric_limits<int32_t>::max() - 4096))
        throw std::invalid_argument("there are more points than the native code can count");
    return static_cast<int32_t>(points.shape(0));
}

void evaluate(const surfsup::Solid& solid, Vectors points, NewValues distance, std::optional<NewVectors> normal,
              const std::string& isa, int threads) {
    const int32_t count = count_of(points);
    expect(distance.shape(0), points.shape(0), "distance");
    if (normal) expect(normal->shape(0), points.shape(0), "normal");
    const surfsup::Isa& chosen = surfsup::isa_of(isa);
    const nb::gil_scoped_release unlocked;
    solid.evaluate(points.data(), count, distance.data(), normal ? normal->data() : nullptr, chosen, threads);
}

void make_bvh(surfsup::TriangleBvh* bvh, Points vertices, Faces faces) {
    new (bvh) surfsup::TriangleBvh(vertices.data(), static_cast<int64_t>(vertices.shape(0)), faces.data(),
                                   static_cast<int64_t>(faces.shape(0)));
}

void nearest(const surfsup::TriangleBvh& bvh, Points points, std::optional<Lengths> max_distance, NewLengths distance,
             NewIndices face, NewPoints closest, int threads) {
    const int32_t count = count_of(points);
    if (max_distance) expect(max_distance->shape(0), points.shape(0), "max_distance");
    expect(distance.shape(0), points.shape(0), "distance");
    expect(face.shape(0), points.shape(0), "face");
    expect(closest.shape(0), points.shape(0), "closest");
    const nb::gil_scoped_release unlocked;
    bvh.nearest(points.data(), max_distance ? max_distance->data() : nullptr, count, distance.data(), face.data(),
                closest.data(), threads);
}

void interpolate_grid(const Grid& grid, Points points, NewLengths distance, NewPoints gradient, int threads) {
    const int32_t count = count_of(points);
    expect(distance.shape(0), points.shape(0), "distance");
    expect(gradient.shape(0), points.shape(0), "gradient");
    const auto made = make_grid<double>(grid);
    const nb::gil_scoped_release unlocked;
    surfsup::interpolate(made, points.data(), count, distance.data(), gradient.data(), threads);
}

}  // namespace

surfsup::SolidQuery solid_query(const nb::object& solid, const surfsup::Isa& isa, int threads) {
    if (solid.is_none()) return {};
    if (const surfsup::Solid* native_solid; nb::try_cast(solid, native_solid))
        return [native_solid, &isa, threads](float* points, int32_t count, float* distance, float* normal) {
            native_solid->evaluate(points, count, distance, normal, isa, threads);
        };
    return [&solid](float* points, int32_t count, float* distance, float* normal) {
        const nb::gil_scoped_acquire locked;
        const auto rows = static_cast<size_t>(count);
        if (normal)
            solid(as_vectors(points, rows), as_array(distance, rows), as_vectors(normal, rows));
        else
            solid(as_vectors(points, rows), as_array(distance, rows), nb::none());
    };
}

void add_solids(nb::module_& module) {
    module.def("interpolate_grid", interpolate_grid, "grid"_a, array("points"), array("distance"), array("gradient"),
               "threads"_a);
    nb::class_<surfsup::TriangleBvh>(module, "TriangleBvh")
        .def("__init__", make_bvh, array("vertices"), array("faces"))
        .def("nearest", nearest, array("points"), array("max_distance").none(), array("distance"), array("face"),
             array("closest"), "threads"_a);
    nb::class_<surfsup::Solid>(module, "Solid")
        .def(nb::init<const std::string&, const std::vector<float>&, const std::vector<const surfsup::Solid*>&>(), "kind"_a,
             "parameters"_a, "parts"_a)
        .def_static("of_network", of_network, nb::kw_only(), "layers"_a, array("last"), array("last_bias"),
                    array("code").none(), "frequency"_a, "octaves"_a, "grid"_a.none(), "network_range"_a)
        .def_static("of_mesh", of_mesh, nb::kw_only(), "bvh"_a, "fine"_a, "coarse"_a, array("node_distance"), "mesh_range"_a,
                    "min_agreement"_a, "on_surface"_a, "query_undecided"_a)
        .def("evaluate", evaluate, array("points"), array("distance"), array("normal").none(), "isa"_a, "threads"_a);
}
