// The face of the native step in Python: surfsup.native._native.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <limits>
#include <stdexcept>
#include <tuple>

#include "network.hpp"
#include "solid.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Weight = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Bias = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Vectors = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using NewVectors = nb::ndarray<float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Values = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using NewValues = nb::ndarray<float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Vector = nb::ndarray<const float, nb::shape<3>, nb::c_contig, nb::device::cpu>;

surfsup::Matrix matrix(const Weight& weight) {
    return {weight.data(), static_cast<int64_t>(weight.shape(0)), static_cast<int64_t>(weight.shape(1))};
}

void expect(size_t rows, size_t count, const char* name) {
    if (rows != count)
        throw std::invalid_argument(std::string(name) + " has " + std::to_string(rows) + " rows for " +
                                    std::to_string(count) + " particles");
}

const surfsup::Path& path_of(const std::string& name) {
    for (const surfsup::Path* path : surfsup::paths())
        if (path->name == name) return *path;
    throw std::invalid_argument("this processor cannot go the path '" + name + "'");
}

void make(surfsup::Network* network, std::tuple<Weight, Weight> encoder, std::tuple<Weight, Bias, Weight, Bias> factors,
          const std::vector<std::tuple<Weight, Weight, Weight>>& layers, std::tuple<Weight, Weight> decoder, float radius,
          float close, float frame_time, float fall_lag, float reach, float displacement_scale, float velocity_scale,
          float crowded, float position_share) {
    const auto& [factor_in, factor_in_bias, factor_out, factor_out_bias] = factors;
    expect(factor_in_bias.shape(0), factor_in.shape(0), "a bias of the factors");
    expect(factor_out_bias.shape(0), factor_out.shape(0), "a bias of the factors");
    std::vector<surfsup::Layer> all;
    for (const auto& [mix, own, out] : layers) all.push_back({matrix(mix), matrix(own), matrix(out)});
    new (network) surfsup::Network(
        {radius, close, frame_time, fall_lag, reach, displacement_scale, velocity_scale, crowded, position_share},
        matrix(std::get<0>(encoder)), matrix(std::get<1>(encoder)), matrix(factor_in), factor_in_bias.data(),
        matrix(factor_out), factor_out_bias.data(), all, matrix(std::get<0>(decoder)), matrix(std::get<1>(decoder)));
}

int64_t step(surfsup::Network& network, Vectors positions, Vectors velocities, Vectors displacement, Vectors velocity_change,
          Vectors ahead, Values distance, Vectors normal, Vector gravity, Vector lower, Vector upper,
          NewVectors new_positions, NewVectors new_velocities, const std::string& path, int threads, int64_t most_edges) {
    const size_t count = positions.shape(0);
    if (count >= static_cast<size_t>(std::numeric_limits<int32_t>::max()) / 4)
        throw std::invalid_argument("there are more particles than the native step can count");
    expect(velocities.shape(0), count, "velocities");
    expect(displacement.shape(0), count, "displacement");
    expect(velocity_change.shape(0), count, "velocity_change");
    expect(ahead.shape(0), count, "ahead");
    expect(distance.shape(0), count, "distance");
    expect(normal.shape(0), count, "normal");
    expect(new_positions.shape(0), count, "new_positions");
    expect(new_velocities.shape(0), count, "new_velocities");
    const surfsup::Path& chosen = path_of(path);
    const surfsup::Fluid fluid{static_cast<int32_t>(count), positions.data(), velocities.data(), displacement.data(),
                               velocity_change.data(), ahead.data(), distance.data(), normal.data(), gravity.data(),
                               lower.data(), upper.data(), new_positions.data(), new_velocities.data()};
    const nb::gil_scoped_release unlocked;
    return network.step(fluid, chosen, threads, most_edges);
}

void look(const surfsup::Solid& solid, Vectors points, NewValues distance, NewVectors normal, int threads) {
    const size_t count = points.shape(0);
    if (count > static_cast<size_t>(std::numeric_limits<int32_t>::max() - 4096))
        throw std::invalid_argument("there are more points than a native solid can count");
    expect(distance.shape(0), count, "distance");
    expect(normal.shape(0), count, "normal");
    const nb::gil_scoped_release unlocked;
    solid.look(points.data(), static_cast<int32_t>(count), distance.data(), normal.data(), threads);
}

}  // namespace

NB_MODULE(_native, module) {
    module.def("paths", [] {
        std::vector<std::string> names;
        for (const surfsup::Path* path : surfsup::paths()) names.emplace_back(path->name);
        return names;
    });
    nb::class_<surfsup::Solid>(module, "Solid")
        .def(nb::init<const std::string&, const std::vector<float>&, const std::vector<const surfsup::Solid*>&>(), "kind"_a,
             "numbers"_a, "parts"_a)
        .def("look", look, "points"_a, "distance"_a, "normal"_a, "threads"_a);
    nb::class_<surfsup::Network>(module, "Network")
        .def("__init__", make, nb::kw_only(), "encoder"_a, "factors"_a, "layers"_a, "decoder"_a, "radius"_a, "close"_a,
             "frame_time"_a, "fall_lag"_a, "reach"_a, "displacement_scale"_a, "velocity_scale"_a, "crowded"_a,
             "position_share"_a)
        .def("step", step, "positions"_a, "velocities"_a, "displacement"_a, "velocity_change"_a, "ahead"_a, "distance"_a,
             "normal"_a, "gravity"_a, "lower"_a, "upper"_a, "new_positions"_a, "new_velocities"_a, "path"_a, "threads"_a, "most_edges"_a);
}
