// The neighbor convolution and kernel sums in Python.
#include <optional>

#include "bindings/arrays.hpp"
#include "learned/convolution.hpp"
#include "learned/kernel_sums.hpp"

namespace {

using Kernels = Array<const float, nb::shape<-1, surfsup::KERNELS>>;
using Sums = Array<const float, nb::shape<-1, surfsup::KERNELS, 4>>;
using NewSums = Array<float, nb::shape<-1, surfsup::KERNELS, 4>>;

surfsup::NeighborGraph graph_of(const Indices& starts, const Indices& senders, const Kernels& kernels) {
    expect_graph(starts, senders);
    expect(kernels.shape(0), senders.shape(0), "kernels");
    return {static_cast<int32_t>(starts.shape(0) - 1), starts.data(), senders.data(), kernels.data()};
}

template <typename One, typename Other>
bool same_shape(const One& one, const Other& other) {
    return one.shape(0) == other.shape(0) && one.shape(1) == other.shape(1);
}

int checked_width(const Weight& mix, const Weight& self, const Weight& hidden, const surfsup::NeighborGraph& graph) {
    const size_t width = self.shape(0);
    if (width == 0 || width > 4096 || width % surfsup::CHANNELS || self.shape(1) != width ||
        mix.shape(0) != surfsup::KERNELS * width || mix.shape(1) != width || hidden.shape(1) != width)
        throw std::invalid_argument("the native convolution needs weights of one width, a multiple of 16 up to 4096");
    expect(hidden.shape(0), static_cast<size_t>(graph.count), "hidden");
    return static_cast<int>(width);
}

void convolve(Indices starts, Indices senders, Kernels kernels, Weight hidden, Weight mix, Weight self, NewWeight out,
              int threads) {
    const surfsup::NeighborGraph graph = graph_of(starts, senders, kernels);
    const int width = checked_width(mix, self, hidden, graph);
    if (!same_shape(out, hidden)) throw std::invalid_argument("out must have the shape of hidden");
    const nb::gil_scoped_release unlocked;
    surfsup::convolve(graph, width, hidden.data(), mix.data(), self.data(), out.data(), threads);
}

void convolve_gradient(Indices starts, Indices senders, Kernels kernels, Weight hidden, Weight mix, Weight self,
                       Weight out_gradient, std::optional<NewWeight> hidden_gradient, NewWeight mix_gradient,
                       NewWeight self_gradient, int threads) {
    const surfsup::NeighborGraph graph = graph_of(starts, senders, kernels);
    const int width = checked_width(mix, self, hidden, graph);
    if (!same_shape(out_gradient, hidden) || (hidden_gradient && !same_shape(*hidden_gradient, hidden)) ||
        !same_shape(mix_gradient, mix) || !same_shape(self_gradient, self))
        throw std::invalid_argument("a gradient must have the shape of its argument");
    const nb::gil_scoped_release unlocked;
    surfsup::convolve_gradient(graph, width, hidden.data(), mix.data(), self.data(), out_gradient.data(),
                               hidden_gradient ? hidden_gradient->data() : nullptr, mix_gradient.data(), self_gradient.data(),
                               threads);
}

void sum_kernels(Indices starts, Indices senders, Kernels kernels, Fours values, NewSums sums, int threads) {
    const surfsup::NeighborGraph graph = graph_of(starts, senders, kernels);
    expect(values.shape(0), static_cast<size_t>(graph.count), "values");
    expect(sums.shape(0), static_cast<size_t>(graph.count), "sums");
    const nb::gil_scoped_release unlocked;
    surfsup::sum_kernels(graph, values.data(), sums.data(), threads);
}

void sum_kernels_gradient(Indices starts, Indices senders, Kernels kernels, Sums sums_gradient, NewFours values_gradient,
                          int threads) {
    const surfsup::NeighborGraph graph = graph_of(starts, senders, kernels);
    expect(sums_gradient.shape(0), static_cast<size_t>(graph.count), "sums_gradient");
    expect(values_gradient.shape(0), static_cast<size_t>(graph.count), "values_gradient");
    const nb::gil_scoped_release unlocked;
    surfsup::sum_kernels_gradient(graph, sums_gradient.data(), values_gradient.data(), threads);
}

}  // namespace

void add_networks(nb::module_& module) {
    module.def("convolve", convolve, array("starts"), array("senders"), array("kernels"), array("hidden"), array("mix"),
               array("self"), array("out"), "threads"_a);
    module.def("convolve_gradient", convolve_gradient, array("starts"), array("senders"), array("kernels"), array("hidden"),
               array("mix"), array("self"), array("out_gradient"), array("hidden_gradient").none(), array("mix_gradient"),
               array("self_gradient"), "threads"_a);
    module.def("sum_kernels", sum_kernels, array("starts"), array("senders"), array("kernels"), array("values"), array("sums"),
               "threads"_a);
    module.def("sum_kernels_gradient", sum_kernels_gradient, array("starts"), array("senders"), array("kernels"),
               array("sums_gradient"), array("values_gradient"), "threads"_a);
}
