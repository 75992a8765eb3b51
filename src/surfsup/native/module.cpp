// The face of the native step in Python: surfsup.native._native.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <stdexcept>
#include <tuple>

#include "convolution.hpp"
#include "guard.hpp"
#include "mesh.hpp"
#include "network.hpp"
#include "rollout.hpp"
#include "solid.hpp"
#include "triangles.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Weight = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Bias = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Vectors = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using NewVectors = nb::ndarray<float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Turn = nb::ndarray<const float, nb::shape<3, 3>, nb::c_contig, nb::device::cpu>;
using Whole = nb::ndarray<const int32_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Nodes = nb::ndarray<const float, nb::shape<-1, 2, surfsup::NODES>, nb::c_contig, nb::device::cpu>;
using NewActions = nb::ndarray<float, nb::shape<-1, surfsup::ACTIONS>, nb::c_contig, nb::device::cpu>;
using NewSurroundings = nb::ndarray<float, nb::shape<-1, surfsup::SURROUNDINGS>, nb::c_contig, nb::device::cpu>;
using Values = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Starts = nb::ndarray<const int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Indices = Starts;
using Kernels = nb::ndarray<const float, nb::shape<-1, surfsup::KERNELS>, nb::c_contig, nb::device::cpu>;
using NewWeight = nb::ndarray<float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Fours = nb::ndarray<const float, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;
using NewFours = nb::ndarray<float, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;
using Sums = nb::ndarray<const float, nb::shape<-1, surfsup::KERNELS, 4>, nb::c_contig, nb::device::cpu>;
using NewSums = nb::ndarray<float, nb::shape<-1, surfsup::KERNELS, 4>, nb::c_contig, nb::device::cpu>;
using NewFlags = nb::ndarray<bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Flags = nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using NewValues = nb::ndarray<float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Vector = nb::ndarray<const float, nb::shape<3>, nb::c_contig, nb::device::cpu>;
using Points = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using NewPoints = nb::ndarray<double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Lengths = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using NewLengths = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Faces = nb::ndarray<const int64_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using NewIndices = nb::ndarray<int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

surfsup::Matrix matrix(const Weight& weight) {
    return {weight.data(), static_cast<int64_t>(weight.shape(0)), static_cast<int64_t>(weight.shape(1))};
}

void expect(size_t rows, size_t count, const char* name) {
    if (rows != count)
        throw std::invalid_argument(std::string(name) + " has " + std::to_string(rows) + " rows, but must have " +
                                    std::to_string(count));
}

const surfsup::Path& path_of(const std::string& name) {
    for (const surfsup::Path* path : surfsup::paths())
        if (path->name == name) return *path;
    throw std::invalid_argument("this processor cannot go the path '" + name + "'");
}

// A network, and what keeps the memory of its weights and tables.
struct HeldNetwork {
    std::vector<Weight> weights;
    std::vector<Bias> biases;
    surfsup::Network network;
};

void make(HeldNetwork* network, const Weight& encoder, std::tuple<Weight, Bias, Weight, Bias> factors,
          const std::vector<std::tuple<Weight, Weight, Weight>>& layers, std::tuple<Weight, Weight> decoder,
          std::tuple<Bias, float, float, float, float, float, float, float, float> solids, float radius, float frame_time,
          float displacement_scale, float velocity_scale, float slope_scale, float density_scale, float own_density,
          int steps, float of_rise, float of_excess, float slow, float least, float most_dense, float viscosity, float softened,
          float pressure_scale, float position_share, float largest,
          const std::array<float, surfsup::SURROUNDINGS>& thickest) {
    const auto& [factor_in, factor_in_bias, factor_out, factor_out_bias] = factors;
    expect(factor_in_bias.shape(0), factor_in.shape(0), "a bias of the factors");
    expect(factor_out_bias.shape(0), factor_out.shape(0), "a bias of the factors");
    const auto& [decode_in, decode_out] = decoder;
    const auto& [share, deepest, between, support, nearest, offset, strength, wall_cell, closest] = solids;
    if (steps < 1) throw std::invalid_argument("a frame has one step at least");
    if (share.shape(0) < 2) throw std::invalid_argument("the solids' share has fewer than two entries");
    std::vector<Weight> weights{encoder, factor_in, factor_out, decode_in, decode_out};
    std::vector<surfsup::Layer> all;
    for (const auto& [mix, own, out] : layers) {
        all.push_back({matrix(mix), matrix(own), matrix(out)});
        weights.insert(weights.end(), {mix, own, out});
    }
    new (network) HeldNetwork{
        std::move(weights),
        {factor_in_bias, factor_out_bias, share},
        {{radius, frame_time, displacement_scale, velocity_scale, slope_scale, density_scale, own_density,
          steps, of_rise, of_excess, slow, least, most_dense, viscosity, softened, pressure_scale, position_share, largest, thickest},
         {deepest, between, support, nearest, offset, strength, wall_cell, closest, static_cast<int>(share.shape(0)), share.data()},
         matrix(encoder), matrix(factor_in), factor_in_bias.data(), matrix(factor_out),
         factor_out_bias.data(), all, matrix(decode_in), matrix(decode_out)}};
}

void make_map(surfsup::SolidMap* map, Vector lower, Vector cell, Whole resolution, Whole places, Nodes nodes) {
    expect(resolution.shape(0), 3, "resolution");
    int64_t cells = 1;
    for (int axis = 0; axis < 3; ++axis) cells *= resolution.data()[axis];
    expect(places.shape(0), static_cast<size_t>(cells), "places");
    for (int64_t k = 0; k < cells; ++k)
        if (places.data()[k] >= static_cast<int64_t>(nodes.shape(0)) - 1) throw std::invalid_argument("a cell has nodes that are not there");
    new (map) surfsup::SolidMap{{lower.data(), lower.data() + 3}, {}, {nodes.data(), nodes.data() + nodes.size()},
                                {resolution.data(), resolution.data() + 3}, {places.data(), places.data() + cells}};
    for (int axis = 0; axis < 3; ++axis) map->per_cell.push_back(1.0f / cell.data()[axis]);
}

surfsup::Fluid fluid_of(const Vectors& positions, const Vectors& velocities, const Vectors& ahead, const Values& distance,
                        const Vectors& normal, const Vector& gravity, const Vector& lower, const Vector& upper,
                        const surfsup::SolidMap* map, const Turn& turn) {
    const size_t count = velocities.shape(0);
    if (count >= static_cast<size_t>(std::numeric_limits<int32_t>::max()) / surfsup::MOTION)
        throw std::invalid_argument("there are more particles than the native step can count");
    expect(positions.shape(0), count, "positions");
    expect(ahead.shape(0), count, "ahead");
    expect(distance.shape(0), count, "distance");
    expect(normal.shape(0), count, "normal");
    return {static_cast<int32_t>(count), positions.data(), velocities.data(), ahead.data(), distance.data(), normal.data(),
            gravity.data(), lower.data(), upper.data(), map ? map->view(turn.data()) : surfsup::MapView{}};
}

int64_t observe(HeldNetwork& held, Vectors positions, Vectors velocities, Vectors ahead, Values distance, Vectors normal, Vector gravity,
                Vector lower, Vector upper, const surfsup::SolidMap* map, Turn turn, NewActions acts, NewSurroundings lie, NewVectors faster, NewVectors farther, NewVectors slope, NewVectors places,
                const std::string& path, int threads, int64_t most_edges) {
    const surfsup::Fluid fluid = fluid_of(positions, velocities, ahead, distance, normal, gravity, lower, upper, map, turn);
    for (const size_t rows : {acts.shape(0), lie.shape(0), faster.shape(0), farther.shape(0), slope.shape(0), places.shape(0)})
        expect(rows, velocities.shape(0), "what is told");
    const surfsup::Path& chosen = path_of(path);
    const nb::gil_scoped_release unlocked;
    return held.network.observe(fluid, {acts.data(), lie.data(), faster.data(), farther.data(), slope.data(), places.data()}, chosen, threads, most_edges);
}

// A network of a solid, and what keeps the memory of its weights and of its lattice.
struct HeldField {
    std::vector<Weight> weights;
    std::vector<Values> last;
    std::optional<Fours> table;
    std::vector<surfsup::FieldLayer> layers;
    std::vector<float> constants;  // of every layer, as they are when it is made
    surfsup::Field field;
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
    held->last = {last};
    if (lattice) held->table = std::get<0>(*lattice);
    for (const GivenLayer& layer : layers) {
        const auto& [hidden, entering, biases, of_code] = layer;
        const bool first = held->layers.empty();
        if (hidden && (hidden->shape(0) != width || hidden->shape(1) != width)) throw std::invalid_argument("a layer is not of the field's width");
        if (entering && (entering->shape(0) != width || entering->shape(1) != static_cast<size_t>(3 + 6 * octaves)))
            throw std::invalid_argument("what enters a layer is not what is told of a place");
        if (first ? hidden || !entering : !hidden) throw std::invalid_argument("into the first layer comes the place, into all others the layer before");
        const std::vector<float> constants = constants_of(layer, code, width);
        held->constants.insert(held->constants.end(), constants.begin(), constants.end());
        held->layers.push_back({hidden ? hidden->data() : nullptr, entering ? entering->data() : nullptr, nullptr});
        if (hidden) held->weights.push_back(*hidden);
        if (entering) held->weights.push_back(*entering);
    }
    for (size_t k = 0; k < layers.size(); ++k) held->layers[k].bias = held->constants.data() + k * width;
    held->field = {held->layers.data(), static_cast<int>(layers.size()), static_cast<int>(width), octaves, frequency,
                   last.data(), last_bias.data()[0], lattice_of(lattice), near};
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
    expect(unsigned_distance.shape(0), std::get<0>(fine).shape(0), "unsigned");
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

void look(const surfsup::Solid& solid, Vectors points, NewValues distance, std::optional<NewVectors> normal, int threads) {
    const size_t count = points.shape(0);
    if (count > static_cast<size_t>(std::numeric_limits<int32_t>::max() - 4096))
        throw std::invalid_argument("there are more points than a native solid can count");
    expect(distance.shape(0), count, "distance");
    if (normal) expect(normal->shape(0), count, "normal");
    const nb::gil_scoped_release unlocked;
    solid.look(points.data(), static_cast<int32_t>(count), distance.data(), normal ? normal->data() : nullptr, threads);
}

surfsup::Sparse sparse(const Starts& starts, const Indices& senders, const Kernels& kernels) {
    if (starts.shape(0) == 0 || starts.shape(0) > std::numeric_limits<int32_t>::max())
        throw std::invalid_argument("the starts are those of no number of particles that can be counted");
    expect(kernels.shape(0), senders.shape(0), "kernels");
    return {static_cast<int32_t>(starts.shape(0) - 1), starts.data(), senders.data(), kernels.data()};
}

surfsup::Channels channels_of(const Weight& mix, const Weight& own, const Weight& hidden, const surfsup::Sparse& edges) {
    const size_t width = own.shape(0), messages = mix.shape(1);
    if (width == 0 || width % surfsup::CHANNELS || messages == 0 || messages % surfsup::CHANNELS || messages > width ||
        own.shape(1) != width || mix.shape(0) != surfsup::KERNELS * width || hidden.shape(1) != width)
        throw std::invalid_argument("the native convolution is for multiples of 16 channels that fit each other");
    expect(hidden.shape(0), static_cast<size_t>(edges.count), "hidden");
    return {static_cast<int>(width), static_cast<int>(messages)};
}

void convolve(Starts starts, Indices senders, Kernels kernels, Weight hidden, Weight mix, Weight own, NewWeight out,
              int threads) {
    const surfsup::Sparse edges = sparse(starts, senders, kernels);
    const surfsup::Channels channels = channels_of(mix, own, hidden, edges);
    if (out.shape(0) != hidden.shape(0) || out.shape(1) != hidden.shape(1)) throw std::invalid_argument("out is not as hidden");
    const nb::gil_scoped_release unlocked;
    surfsup::convolve(edges, channels, hidden.data(), mix.data(), own.data(), out.data(), threads);
}

void convolve_back(Starts starts, Indices senders, Kernels kernels, Weight hidden, Weight mix, Weight own, Weight gradient,
                   std::optional<NewWeight> to_hidden, NewWeight to_mix, NewWeight to_own, int threads) {
    const surfsup::Sparse edges = sparse(starts, senders, kernels);
    const surfsup::Channels channels = channels_of(mix, own, hidden, edges);
    const auto same = [](const auto& one, const Weight& other) {
        return one.shape(0) == other.shape(0) && one.shape(1) == other.shape(1);
    };
    if (!same(gradient, hidden) || (to_hidden && !same(*to_hidden, hidden)) || !same(to_mix, mix) || !same(to_own, own))
        throw std::invalid_argument("a gradient is not as what it is of");
    const nb::gil_scoped_release unlocked;
    surfsup::convolve_back(edges, channels, hidden.data(), mix.data(), own.data(), gradient.data(),
                           to_hidden ? to_hidden->data() : nullptr, to_mix.data(), to_own.data(), threads);
}

void sum_fours(Starts starts, Indices senders, Kernels kernels, Fours values, NewSums sums, int threads) {
    const surfsup::Sparse edges = sparse(starts, senders, kernels);
    expect(values.shape(0), static_cast<size_t>(edges.count), "values");
    expect(sums.shape(0), static_cast<size_t>(edges.count), "sums");
    const nb::gil_scoped_release unlocked;
    surfsup::sum_fours(edges, values.data(), sums.data(), threads);
}

void sum_fours_back(Starts starts, Indices senders, Kernels kernels, Sums gradient, NewFours to_values, int threads) {
    const surfsup::Sparse edges = sparse(starts, senders, kernels);
    expect(gradient.shape(0), static_cast<size_t>(edges.count), "gradient");
    expect(to_values.shape(0), static_cast<size_t>(edges.count), "to_values");
    const nb::gil_scoped_release unlocked;
    surfsup::sum_fours_back(edges, gradient.data(), to_values.data(), threads);
}

// An array of Python's that the vector becomes.
nb::ndarray<nb::numpy, int64_t, nb::ndim<1>> as_array(std::vector<int64_t>&& values) {
    auto* kept = new std::vector<int64_t>(std::move(values));
    nb::capsule owner(kept, [](void* vector) noexcept { delete static_cast<std::vector<int64_t>*>(vector); });
    return {kept->data(), {kept->size()}, owner};
}

// Whom to ask for distances: a native solid, a function of Python's that writes what it knows, or nobody.
surfsup::Ask ask_of(const nb::object& solid, int threads) {
    if (solid.is_none()) return {};
    if (const surfsup::Solid* known; nb::try_cast(solid, known))
        return [known, threads](float* points, int32_t count, float* distance, float* normal) {
            known->look(points, count, distance, normal, threads);
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

// Metres of clearance and short of it, and rounds of pushes.
using Allowed = std::tuple<float, float, int>;

int32_t particles_of(size_t count) {
    if (count > static_cast<size_t>(std::numeric_limits<int32_t>::max() - 4096))
        throw std::invalid_argument("there are more particles than can be counted");
    return static_cast<int32_t>(count);
}

nb::tuple next_frame(HeldNetwork& held, Vectors positions, Vectors velocities, std::tuple<Vector, Vector, Vector, Vector> around,
                     const surfsup::SolidMap* map, Turn turn, const nb::object& solid, Allowed clearance, bool guarded,
                     double most_gain, std::tuple<NewVectors, NewValues> last, std::tuple<NewVectors, NewVectors, NewFlags> reached,
                     const std::string& path, int threads, int64_t most_edges) {
    const auto& [gravity, drop, lower, upper] = around;
    const auto& [places, distance] = last;
    const auto& [new_positions, new_velocities, moved] = reached;
    const size_t count = positions.shape(0);
    if (count >= static_cast<size_t>(std::numeric_limits<int32_t>::max()) / surfsup::MOTION)
        throw std::invalid_argument("there are more particles than the native step can count");
    expect(velocities.shape(0), count, "velocities");
    expect(places.shape(0), count, "places");
    expect(distance.shape(0), count, "distance");
    expect(new_positions.shape(0), count, "new_positions");
    expect(new_velocities.shape(0), count, "new_velocities");
    expect(moved.shape(0), count, "moved");
    const surfsup::Path& chosen = path_of(path);
    const surfsup::Ask ask = ask_of(solid, threads);
    const auto& [metres, tolerance, rounds] = clearance;
    const surfsup::Fluid fluid = {static_cast<int32_t>(count), positions.data(), velocities.data(), nullptr, nullptr, nullptr,
                                  gravity.data(), lower.data(), upper.data(), map ? map->view(turn.data()) : surfsup::MapView{}};
    surfsup::Outcome outcome;
    {
        const nb::gil_scoped_release unlocked;
        outcome = surfsup::next_frame(held.network, fluid, drop.data(), ask, {lower.data(), upper.data(), metres, tolerance, rounds}, guarded,
                                      most_gain, {places.data(), distance.data()},
                                      {new_positions.data(), new_velocities.data(), moved.data()}, chosen, threads, most_edges);
    }
    return nb::make_tuple(outcome.edges, outcome.done);
}

void guard(Vectors before, NewVectors positions, NewVectors velocities, NewFlags moved, Vector lower, Vector upper, Allowed clearance,
           const nb::object& solid, std::optional<std::tuple<Vectors, Values>> last, int threads) {
    const size_t count = positions.shape(0);
    expect(before.shape(0), count, "before");
    expect(velocities.shape(0), count, "velocities");
    expect(moved.shape(0), count, "moved");
    if (last) expect(std::get<0>(*last).shape(0), count, "places");
    if (last) expect(std::get<1>(*last).shape(0), count, "distance");
    const surfsup::Ask ask = ask_of(solid, threads);
    const auto& [metres, tolerance, rounds] = clearance;
    const nb::gil_scoped_release unlocked;
    surfsup::guard(before.data(), positions.data(), velocities.data(), moved.data(), particles_of(count),
                   {lower.data(), upper.data(), metres, tolerance, rounds}, ask, last ? std::get<0>(*last).data() : nullptr,
                   last ? std::get<1>(*last).data() : nullptr);
}

double energy_gain(Vectors positions, Vectors velocities, Vectors new_positions, Vectors new_velocities, Vector gravity) {
    const size_t count = positions.shape(0);
    expect(velocities.shape(0), count, "velocities");
    expect(new_positions.shape(0), count, "new_positions");
    expect(new_velocities.shape(0), count, "new_velocities");
    return surfsup::energy_gain(positions.data(), velocities.data(), new_positions.data(), new_velocities.data(),
                                static_cast<int64_t>(count), gravity.data());
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

nb::tuple find_pairs(Vectors positions, double radius, int64_t most_edges, int threads) {
    if (positions.shape(0) >= static_cast<size_t>(std::numeric_limits<int32_t>::max()) / 4)
        throw std::invalid_argument("there are more particles than the native search can count");
    surfsup::Pairs pairs;
    {
        const nb::gil_scoped_release unlocked;
        pairs = surfsup::find_pairs(positions.data(), static_cast<int32_t>(positions.shape(0)), static_cast<float>(radius),
                                    radius, most_edges, threads);
    }
    return nb::make_tuple(pairs.edges, as_array(std::move(pairs.starts)), as_array(std::move(pairs.receivers)),
                          as_array(std::move(pairs.senders)));
}

}  // namespace

// An argument that is never converted: what is written to a copy would be lost.
auto array(const char* name) { return nb::arg(name).noconvert(); }

NB_MODULE(_native, module) {
    module.def("paths", [] {
        std::vector<std::string> names;
        for (const surfsup::Path* path : surfsup::paths()) names.emplace_back(path->name);
        return names;
    });
    module.def("convolve", convolve, array("starts"), array("senders"), array("kernels"), array("hidden"), array("mix"),
               array("own"), array("out"), "threads"_a);
    module.def("convolve_back", convolve_back, array("starts"), array("senders"), array("kernels"), array("hidden"),
               array("mix"), array("own"), array("gradient"), array("to_hidden").none(), array("to_mix"), array("to_own"),
               "threads"_a);
    module.def("sum_fours", sum_fours, array("starts"), array("senders"), array("kernels"), array("values"), array("sums"),
               "threads"_a);
    module.def("sum_fours_back", sum_fours_back, array("starts"), array("senders"), array("kernels"), array("gradient"),
               array("to_values"), "threads"_a);
    module.def("guard", guard, array("before"), array("positions"), array("velocities"), array("moved"), array("lower"), array("upper"),
               "clearance"_a, "solid"_a.none(), "last"_a.none(), "threads"_a);
    module.def("energy_gain", energy_gain, array("positions"), array("velocities"), array("new_positions"),
               array("new_velocities"), array("gravity"));
    module.def("find_pairs", find_pairs, array("positions"), "radius"_a, "most_edges"_a, "threads"_a);
    module.def("sample", sample, "grid"_a, array("points"), array("distance"), array("gradient"), "threads"_a);
    nb::class_<surfsup::Triangles>(module, "Triangles")
        .def("__init__", make_triangles, array("vertices"), array("faces"))
        .def("nearest", nearest, array("points"), array("at_most").none(), array("distance"), array("face"),
             array("closest"), "threads"_a);
    nb::class_<surfsup::SolidMap>(module, "SolidMap")
        .def("__init__", make_map, array("lower"), array("cell"), array("resolution"), array("places"), array("nodes"));

    nb::class_<surfsup::Solid>(module, "Solid")
        .def(nb::init<const std::string&, const std::vector<float>&, const std::vector<const surfsup::Solid*>&>(), "kind"_a,
             "numbers"_a, "parts"_a)
        .def_static("of_network", of_network, nb::kw_only(), "layers"_a, array("last"), array("last_bias"), array("code").none(),
                    "frequency"_a, "octaves"_a, "lattice"_a.none(), "near"_a)
        .def_static("of_mesh", of_mesh, nb::kw_only(), "triangles"_a, "fine"_a, "coarse"_a, array("unsigned_distance"), array("inside"),
                    "near"_a, "agree"_a, "touching"_a, "rest"_a)
        .def("look", look, array("points"), array("distance"), array("normal").none(), "threads"_a);
    nb::class_<HeldNetwork>(module, "Network")
        .def("__init__", make, nb::kw_only(), array("encoder"), array("factors"), array("layers"), array("decoder"),
             "solids"_a, "radius"_a, "frame_time"_a, "displacement_scale"_a, "velocity_scale"_a, "slope_scale"_a,
             "density_scale"_a, "own_density"_a, "steps"_a, "of_rise"_a, "of_excess"_a, "slow"_a, "least"_a, "most_dense"_a, "viscosity"_a,
             "softened"_a, "pressure_scale"_a, "position_share"_a, "largest"_a, "thickest"_a)
        .def("next_frame", next_frame, array("positions"), array("velocities"), array("around"), "map"_a.none(), array("turn"), "solid"_a.none(),
             "clearance"_a, "guarded"_a, "most_gain"_a, array("last"), array("reached"), "path"_a, "threads"_a, "most_edges"_a)
        .def("observe", observe, array("positions"), array("velocities"),
             array("ahead"), array("distance"), array("normal"), array("gravity"), array("lower"), array("upper"), "map"_a.none(), array("turn"),
             array("acts"), array("lie"), array("faster"), array("farther"), array("slope"), array("places"), "path"_a, "threads"_a, "most_edges"_a);
}
