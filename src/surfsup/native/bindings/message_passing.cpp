// The perceptrons of message-passing networks in Python.
#include "learned/message_passing.hpp"

#include <limits>
#include <optional>
#include <tuple>

#include "bindings/arrays.hpp"

namespace {

using surfsup::Precision;

using Any = nb::ndarray<nb::c_contig, nb::device::cpu>;  // float32, or the bits of bfloat16 as uint16
using Weights = std::tuple<Weight, std::optional<Values>, Weight, Values, Weight, Values, Values, Values>;
using NewWeights =
    std::tuple<NewWeight, std::optional<NewValues>, NewWeight, NewValues, NewWeight, NewValues, NewValues, NewValues>;
using Kept = std::tuple<Any, Any, Any, NewValues>;

Precision precision_of(const Any& array) {
    if (array.dtype() == nb::dtype<float>()) return Precision::FLOAT32;
    if (array.dtype() == nb::dtype<uint16_t>()) return Precision::BFLOAT16;
    throw std::invalid_argument("a matrix must be float32, or the bits of bfloat16 as uint16");
}

void expect_matrix(const Any& array, size_t rows, size_t columns, Precision precision, const char* name) {
    if (array.ndim() != 2 || array.shape(0) != rows || array.shape(1) != columns || precision_of(array) != precision)
        throw std::invalid_argument(std::string(name) + " has another shape or precision than it must have");
}

template <typename One, typename Two, typename Three, typename Four, typename Five, typename Six, typename Seven,
          typename Eight>
void expect_shapes(const std::tuple<One, Two, Three, Four, Five, Six, Seven, Eight>& weights, size_t width, size_t depth) {
    const auto& [first, first_bias, hidden, hidden_bias, output, output_bias, scale, shift] = weights;
    const bool fits = first.shape(0) == width && first.shape(1) == depth && (!first_bias || first_bias->shape(0) == width) &&
                      hidden.shape(0) == width && hidden.shape(1) == width && hidden_bias.shape(0) == width &&
                      output.shape(0) == width && output.shape(1) == width && output_bias.shape(0) == width &&
                      scale.shape(0) == width && shift.shape(0) == width;
    if (!fits) throw std::invalid_argument("the weights of a perceptron do not fit together");
}

surfsup::PerceptronWeights weights_of(const Weights& weights, double epsilon) {
    const auto& [first, first_bias, hidden, hidden_bias, output, output_bias, scale, shift] = weights;
    const size_t width = first.shape(0), depth = first.shape(1);
    if (width == 0 || width % surfsup::WIDTH_UNIT || depth == 0 || width > 4096 || depth > 16384)
        throw std::invalid_argument("the width of a native perceptron must be a multiple of 16");
    expect_shapes(weights, width, depth);
    return {static_cast<int>(depth),
            static_cast<int>(width),
            first.data(),
            first_bias ? first_bias->data() : nullptr,
            hidden.data(),
            hidden_bias.data(),
            output.data(),
            output_bias.data(),
            scale.data(),
            shift.data(),
            static_cast<float>(epsilon)};
}

surfsup::PerceptronWeightsGradient gradient_of(const NewWeights& gradient, const surfsup::PerceptronWeights& weights) {
    expect_shapes(gradient, static_cast<size_t>(weights.width), static_cast<size_t>(weights.depth));
    const auto& [first, first_bias, hidden, hidden_bias, output, output_bias, scale, shift] = gradient;
    return {first.data(),  first_bias ? first_bias->data() : nullptr,
            hidden.data(), hidden_bias.data(),
            output.data(), output_bias.data(),
            scale.data(),  shift.data()};
}

surfsup::Activations activations_of(const std::optional<Kept>& kept, size_t rows, int width, Precision precision) {
    if (!kept) return {};
    const auto& [hidden_1, hidden_2, normalized, inverse_std] = *kept;
    for (const Any* matrix : {&hidden_1, &hidden_2, &normalized})
        expect_matrix(*matrix, rows, static_cast<size_t>(width), precision, "a kept matrix");
    expect(inverse_std.shape(0), rows, "inverse_std");
    return {hidden_1.data(), hidden_2.data(), normalized.data(), inverse_std.data()};
}

int32_t count_of(size_t rows) {
    if (rows > static_cast<size_t>(std::numeric_limits<int32_t>::max()))
        throw std::invalid_argument("more rows than fit 32 bits");
    return static_cast<int32_t>(rows);
}

// The arrays that both passes on rows have; `out` may be its gradient.
surfsup::RowPass row_pass(const Weight& rows, const Any& out, const surfsup::PerceptronWeights& weights, Precision precision) {
    if (rows.shape(1) != static_cast<size_t>(weights.depth)) throw std::invalid_argument("rows do not fit the weights");
    surfsup::RowPass pass{};
    pass.rows = rows.data();
    pass.out_float32 = precision_of(out) == Precision::FLOAT32;
    expect_matrix(out, rows.shape(0), static_cast<size_t>(weights.width), pass.out_float32 ? Precision::FLOAT32 : precision,
                  "out");
    return pass;
}

Precision precision_if(bool bfloat16) { return bfloat16 ? Precision::BFLOAT16 : Precision::FLOAT32; }

void rows_forward(Weight rows, Weights arrays, double epsilon, std::optional<Kept> kept, Any out, bool first_bfloat16,
                  bool bfloat16, const std::string& isa, int threads) {
    const auto weights = weights_of(arrays, epsilon);
    const Precision precision = precision_if(bfloat16), first = precision_if(first_bfloat16);
    surfsup::RowPass pass = row_pass(rows, out, weights, precision);
    pass.out = out.data();
    pass.kept = activations_of(kept, rows.shape(0), weights.width, precision);
    const int32_t count = count_of(rows.shape(0));
    const nb::gil_scoped_release unlocked;
    surfsup::rows_forward(surfsup::isa_of(isa), first, precision, pass, weights, count, threads);
}

void rows_backward(Weight rows, Weights arrays, double epsilon, Kept kept, Any out_gradient,
                   std::optional<NewWeight> rows_gradient, NewWeights arrays_gradient, bool first_bfloat16,
                   const std::string& isa, int threads) {
    const auto weights = weights_of(arrays, epsilon);
    const Precision precision = precision_of(std::get<0>(kept)), first = precision_if(first_bfloat16);
    surfsup::RowPass pass = row_pass(rows, out_gradient, weights, precision);
    if (rows_gradient && (rows_gradient->shape(0) != rows.shape(0) || rows_gradient->shape(1) != rows.shape(1)))
        throw std::invalid_argument("a gradient must have the shape of its argument");
    pass.out_gradient = out_gradient.data();
    pass.rows_gradient = rows_gradient ? rows_gradient->data() : nullptr;
    pass.kept = activations_of(kept, rows.shape(0), weights.width, precision);
    const auto gradient = gradient_of(arrays_gradient, weights);
    const int32_t count = count_of(rows.shape(0));
    const nb::gil_scoped_release unlocked;
    surfsup::rows_backward(surfsup::isa_of(isa), first, precision, pass, weights, gradient, count, threads);
}

// The arrays that both passes on edges have.
surfsup::EdgePass edge_pass(const Indices& starts, const Indices& senders, const Any& edges,
                            const surfsup::PerceptronWeights& weights, Precision precision) {
    expect_graph(starts, senders);
    if (weights.depth != weights.width) throw std::invalid_argument("the first layer of an edge must be square");
    expect_matrix(edges, senders.shape(0), static_cast<size_t>(weights.width), precision, "edges");
    surfsup::EdgePass pass{};
    pass.starts = starts.data(), pass.senders = senders.data(), pass.edges = edges.data();
    return pass;
}

void edges_forward(Indices starts, Indices senders, Any endpoints, Any edges, Weights arrays, double epsilon,
                   std::optional<Kept> kept, NewWeight received, std::optional<Any> new_edges, const std::string& isa,
                   int threads) {
    const auto weights = weights_of(arrays, epsilon);
    const Precision precision = precision_of(edges);
    surfsup::EdgePass pass = edge_pass(starts, senders, edges, weights, precision);
    const size_t count = starts.shape(0) - 1, width = static_cast<size_t>(weights.width);
    expect_matrix(endpoints, count, 2 * width, precision, "endpoints");
    if (new_edges) expect_matrix(*new_edges, senders.shape(0), width, precision, "new_edges");
    if (received.shape(0) != count || received.shape(1) != width)
        throw std::invalid_argument("received must have a row for each node");
    pass.endpoints = endpoints.data(), pass.received = received.data();
    pass.new_edges = new_edges ? new_edges->data() : nullptr;
    pass.kept = activations_of(kept, senders.shape(0), weights.width, precision);
    const int32_t nodes = count_of(count);
    const nb::gil_scoped_release unlocked;
    surfsup::edges_forward(surfsup::isa_of(isa), precision, pass, weights, nodes, threads);
}

void edges_backward(Indices starts, Indices senders, Any edges, Weights arrays, double epsilon, Kept kept,
                    Weight received_gradient, std::optional<Any> new_edges_gradient, Any edges_gradient, Any first_gradient,
                    Any endpoints_gradient, NewWeights arrays_gradient, const std::string& isa, int threads) {
    const auto weights = weights_of(arrays, epsilon);
    const Precision precision = precision_of(edges);
    surfsup::EdgePass pass = edge_pass(starts, senders, edges, weights, precision);
    const size_t count = starts.shape(0) - 1, width = static_cast<size_t>(weights.width);
    for (const Any* matrix : {&edges_gradient, &first_gradient})
        expect_matrix(*matrix, senders.shape(0), width, precision, "a gradient of edges");
    if (new_edges_gradient) expect_matrix(*new_edges_gradient, senders.shape(0), width, precision, "new_edges_gradient");
    expect_matrix(endpoints_gradient, count, 2 * width, precision, "endpoints_gradient");
    if (received_gradient.shape(0) != count || received_gradient.shape(1) != width)
        throw std::invalid_argument("received_gradient must have a row for each node");
    pass.received_gradient = received_gradient.data();
    pass.new_edges_gradient = new_edges_gradient ? new_edges_gradient->data() : nullptr;
    pass.edges_gradient = edges_gradient.data(), pass.first_gradient = first_gradient.data();
    pass.endpoints_gradient = endpoints_gradient.data();
    pass.kept = activations_of(kept, senders.shape(0), weights.width, precision);
    const auto gradient = gradient_of(arrays_gradient, weights);
    const int32_t nodes = count_of(count);
    const nb::gil_scoped_release unlocked;
    surfsup::edges_backward(surfsup::isa_of(isa), precision, pass, weights, gradient, nodes, threads);
}

}  // namespace

void add_message_passing(nb::module_& module) {
    module.def("has_bfloat16", [](const std::string& isa) { return surfsup::has_bfloat16(surfsup::isa_of(isa)); }, "isa"_a);
    module.def("rows_forward", rows_forward, array("rows"), array("weights"), "epsilon"_a, array("kept").none(), array("out"),
               "first_bfloat16"_a, "bfloat16"_a, "isa"_a, "threads"_a);
    module.def("rows_backward", rows_backward, array("rows"), array("weights"), "epsilon"_a, array("kept"),
               array("out_gradient"), array("rows_gradient").none(), array("weights_gradient"), "first_bfloat16"_a, "isa"_a,
               "threads"_a);
    module.def("edges_forward", edges_forward, array("starts"), array("senders"), array("endpoints"), array("edges"),
               array("weights"), "epsilon"_a, array("kept").none(), array("received"), array("new_edges").none(), "isa"_a,
               "threads"_a);
    module.def("edges_backward", edges_backward, array("starts"), array("senders"), array("edges"), array("weights"),
               "epsilon"_a, array("kept"), array("received_gradient"), array("new_edges_gradient").none(),
               array("edges_gradient"), array("first_gradient"), array("endpoints_gradient"), array("weights_gradient"),
               "isa"_a, "threads"_a);
}
