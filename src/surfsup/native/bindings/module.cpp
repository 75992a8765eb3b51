// The face of the native step in Python: surfsup.native._native.
#include <algorithm>
#include <limits>
#include <optional>
#include <stdexcept>
#include <tuple>

#include "learned/convolution.hpp"
#include "sph/collision.hpp"
#include "bindings/module.hpp"
#include "sph/solver.hpp"
#include "sph/step.hpp"

namespace {

surfsup::Matrix matrix(const Weight& weight) {
    return {weight.data(), static_cast<int64_t>(weight.shape(0)), static_cast<int64_t>(weight.shape(1))};
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

int64_t observe(HeldNetwork& held, Vectors positions, Vectors velocities, Vectors ahead, Values distance, Vectors normal,
                Vector gravity, Vector lower, Vector upper, const surfsup::SolidMap* map, Turn turn, NewActions acts,
                NewSurroundings lie, NewVectors faster, NewVectors farther, NewVectors slope, NewVectors places,
                const std::string& isa, int threads, int64_t most_edges) {
    const surfsup::Fluid fluid = fluid_of(positions, velocities, ahead, distance, normal, gravity, lower, upper, map, turn);
    for (const size_t rows : {acts.shape(0), lie.shape(0), faster.shape(0), farther.shape(0), slope.shape(0), places.shape(0)})
        expect(rows, velocities.shape(0), "what is told");
    const surfsup::Isa& chosen = isa_of(isa);
    const nb::gil_scoped_release unlocked;
    return held.network.observe(fluid, {acts.data(), lie.data(), faster.data(), farther.data(), slope.data(), places.data()}, chosen, threads, most_edges);
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

// Meters of clearance and short of it, and rounds of pushes.
using Allowed = std::tuple<float, float, int>;

int32_t particles_of(size_t count) {
    if (count > static_cast<size_t>(std::numeric_limits<int32_t>::max() - 4096))
        throw std::invalid_argument("there are more particles than can be counted");
    return static_cast<int32_t>(count);
}

nb::tuple next_frame(HeldNetwork& held, Vectors positions, Vectors velocities, std::tuple<Vector, Vector, Vector> around,
                     const surfsup::SolidMap* map, Turn turn, const nb::object& solid, Allowed clearance, bool guarded,
                     double most_gain, std::tuple<NewVectors, NewValues> last, std::tuple<NewVectors, NewVectors, NewFlags> reached,
                     const std::string& isa, int threads, int64_t most_edges) {
    const auto& [gravity, lower, upper] = around;
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
    const surfsup::Isa& chosen = isa_of(isa);
    const surfsup::Ask ask = ask_of(solid, chosen, threads);
    const auto& [meters, tolerance, rounds] = clearance;
    const surfsup::Fluid fluid = {static_cast<int32_t>(count), positions.data(), velocities.data(), nullptr, nullptr, nullptr,
                                  gravity.data(), lower.data(), upper.data(), map ? map->view(turn.data()) : surfsup::MapView{}};
    surfsup::Outcome outcome;
    {
        const nb::gil_scoped_release unlocked;
        outcome = surfsup::next_frame(held.network, fluid, ask, {lower.data(), upper.data(), meters, tolerance, rounds}, guarded,
                                      most_gain, {places.data(), distance.data()},
                                      {new_positions.data(), new_velocities.data(), moved.data()}, chosen, threads, most_edges);
    }
    return nb::make_tuple(outcome.edges, outcome.done);
}

void guard(Vectors before, NewVectors positions, NewVectors velocities, NewFlags moved, Vector lower, Vector upper, Allowed clearance,
           const nb::object& solid, std::optional<std::tuple<Vectors, Values>> last, const std::string& isa, int threads) {
    const size_t count = positions.shape(0);
    expect(before.shape(0), count, "before");
    expect(velocities.shape(0), count, "velocities");
    expect(moved.shape(0), count, "moved");
    if (last) expect(std::get<0>(*last).shape(0), count, "places");
    if (last) expect(std::get<1>(*last).shape(0), count, "distance");
    const surfsup::Ask ask = ask_of(solid, isa_of(isa), threads);
    const auto& [meters, tolerance, rounds] = clearance;
    const nb::gil_scoped_release unlocked;
    surfsup::guard(before.data(), positions.data(), velocities.data(), moved.data(), particles_of(count),
                   {lower.data(), upper.data(), meters, tolerance, rounds}, ask, last ? std::get<0>(*last).data() : nullptr,
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

const surfsup::Isa& isa_of(const std::string& name) {
    for (const surfsup::Isa* isa : surfsup::instruction_sets())
        if (isa->name == name) return *isa;
    throw std::invalid_argument("this processor cannot go the isa '" + name + "'");
}

NB_MODULE(_native, module) {
    module.def("instruction_sets", [] {
        std::vector<std::string> names;
        for (const surfsup::Isa* isa : surfsup::instruction_sets()) names.emplace_back(isa->name);
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
               "clearance"_a, "solid"_a.none(), "last"_a.none(), "isa"_a, "threads"_a);
    module.def("energy_gain", energy_gain, array("positions"), array("velocities"), array("new_positions"),
               array("new_velocities"), array("gravity"));
    module.def("find_pairs", find_pairs, array("positions"), "radius"_a, "most_edges"_a, "threads"_a);
    add_solids(module);
    nb::class_<HeldNetwork>(module, "Network")
        .def("__init__", make, nb::kw_only(), array("encoder"), array("factors"), array("layers"), array("decoder"),
             "solids"_a, "radius"_a, "frame_time"_a, "displacement_scale"_a, "velocity_scale"_a, "slope_scale"_a,
             "density_scale"_a, "own_density"_a, "steps"_a, "of_rise"_a, "of_excess"_a, "slow"_a, "least"_a, "most_dense"_a, "viscosity"_a,
             "softened"_a, "pressure_scale"_a, "position_share"_a, "largest"_a, "thickest"_a)
        .def("next_frame", next_frame, array("positions"), array("velocities"), array("around"), "map"_a.none(), array("turn"), "solid"_a.none(),
             "clearance"_a, "guarded"_a, "most_gain"_a, array("last"), array("reached"), "isa"_a, "threads"_a, "most_edges"_a)
        .def("observe", observe, array("positions"), array("velocities"),
             array("ahead"), array("distance"), array("normal"), array("gravity"), array("lower"), array("upper"), "map"_a.none(), array("turn"),
             array("acts"), array("lie"), array("faster"), array("farther"), array("slope"), array("places"), "isa"_a, "threads"_a, "most_edges"_a);
}
