#include "learned/message_passing.hpp"

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "runtime/aligned.hpp"
#include "runtime/threads.hpp"

namespace surfsup {
namespace {

constexpr int32_t PORTION = 4 * ROW_TILE;  // rows or receivers
constexpr int SLICES = 8;  // of the rows; their gradients are added in this order, whatever the number of threads

const MessagePassingKernels& kernels_of(const Isa& isa, Precision precision) {
    if (precision == Precision::FLOAT32) return isa.learned->float32;
    const MessagePassingKernels* kernels = isa.bfloat16();
    if (!kernels) throw std::invalid_argument(std::string("there is no bfloat16 with the instruction set '") + isa.name + "'");
    return *kernels;
}

void require_first(Precision first, Precision precision) {
    if (first != precision && first != Precision::FLOAT32)
        throw std::invalid_argument("the first layer must have the precision of the others, or float32");
}

uint16_t to_bfloat16(float value) {
    uint32_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    if (value != value) return 0x7FC0;
    return static_cast<uint16_t>((bits + 0x7FFF + ((bits >> 16) & 1)) >> 16);
}

// A packed matrix, see Perceptron. Weight (input, output) is at input * input_step + output * output_step; the columns are
// padded, too.
class Packed {
public:
    Packed(Precision precision, const float* weight, int64_t input_step, int64_t output_step, int inputs, int outputs)
        : values_(static_cast<size_t>(padded(inputs, DEPTH_UNIT) * padded(outputs, WIDTH_UNIT)), 0.0f) {
        const int columns = padded(outputs, WIDTH_UNIT);
        if (precision == Precision::FLOAT32) {
            for (int in = 0; in < inputs; ++in)
                for (int out = 0; out < outputs; ++out)
                    values_[static_cast<size_t>(in * columns + out)] = weight[in * input_step + out * output_step];
        } else {
            auto* to = reinterpret_cast<uint16_t*>(values_.data());
            for (int in = 0; in < inputs; ++in)
                for (int out = 0; out < outputs; ++out)
                    to[(in / 2 * columns + out) * 2 + in % 2] = to_bfloat16(weight[in * input_step + out * output_step]);
        }
    }
    const void* data() const { return values_.data(); }

private:
    AlignedFloats values_;
};

// The packed weights of a perceptron, and what points to them.
class PackedPerceptron {
public:
    PackedPerceptron(const PerceptronWeights& weights, Precision first, Precision precision, bool backward)
        : no_bias_(static_cast<size_t>(padded(std::max(weights.depth, weights.width), WIDTH_UNIT)), 0.0f) {
        const int depth = weights.depth, width = weights.width;
        packed_.reserve(3);
        view_ = {};
        view_.depth = depth, view_.width = width, view_.epsilon = weights.epsilon;
        if (backward) {
            view_.first_transposed = pack(first, weights.first, depth, 1, width, depth);
            view_.hidden_transposed = pack(precision, weights.hidden, width, 1, width, width);
            view_.output_transposed = pack(precision, weights.output, width, 1, width, width);
        } else {
            view_.first = pack(first, weights.first, 1, depth, depth, width);
            view_.hidden = pack(precision, weights.hidden, 1, width, width, width);
            view_.output = pack(precision, weights.output, 1, width, width, width);
        }
        view_.no_bias = no_bias_.data();
        view_.first_bias = weights.first_bias ? weights.first_bias : no_bias_.data();
        view_.hidden_bias = weights.hidden_bias, view_.output_bias = weights.output_bias;
        view_.scale = weights.scale, view_.shift = weights.shift;
    }
    const Perceptron& view() const { return view_; }

private:
    const void* pack(Precision precision, const float* weight, int64_t input_step, int64_t output_step, int inputs,
                     int outputs) {
        packed_.emplace_back(precision, weight, input_step, output_step, inputs, outputs);
        return packed_.back().data();
    }

    std::vector<Packed> packed_;
    AlignedFloats no_bias_;
    Perceptron view_;
};

std::vector<AlignedFloats> scratch_of(int threads, const PerceptronWeights& weights) {
    const auto size = static_cast<size_t>(scratch_size(weights.depth, weights.width));
    return std::vector<AlignedFloats>(static_cast<size_t>(std::max(1, threads)), AlignedFloats(size));
}

// The gradients of all slices, added up at the end.
class GradientSlices {
public:
    explicit GradientSlices(const PerceptronWeights& weights)
        : depth_(weights.depth),
          width_(weights.width),
          size_(static_cast<size_t>(width_ * (padded(depth_, DEPTH_UNIT) + 2 * width_ + 5))),
          sums_(SLICES * size_, 0.0f) {}

    PerceptronGradient slice(int number) {
        const int square = width_ * width_;
        PerceptronGradient gradient{};
        float* at = sums_.data() + static_cast<size_t>(number) * size_;
        gradient.first = at, at += padded(depth_, DEPTH_UNIT) * width_;
        gradient.hidden = at, at += square;
        gradient.output = at, at += square;
        for (float** vector :
             {&gradient.first_bias, &gradient.hidden_bias, &gradient.output_bias, &gradient.scale, &gradient.shift})
            *vector = at, at += width_;
        return gradient;
    }

    void write(const PerceptronWeightsGradient& to) {
        for (size_t number = 1; number < SLICES; ++number)
            for (size_t k = 0; k < size_; ++k) sums_[k] += sums_[number * size_ + k];
        const PerceptronGradient total = slice(0);
        transpose(total.first, depth_, to.first);
        transpose(total.hidden, width_, to.hidden);
        transpose(total.output, width_, to.output);
        if (to.first_bias) std::copy_n(total.first_bias, width_, to.first_bias);
        std::copy_n(total.hidden_bias, width_, to.hidden_bias);
        std::copy_n(total.output_bias, width_, to.output_bias);
        std::copy_n(total.scale, width_, to.scale);
        std::copy_n(total.shift, width_, to.shift);
    }

private:
    void transpose(const float* from, int inputs, float* to) const {
        for (int out = 0; out < width_; ++out)
            for (int in = 0; in < inputs; ++in) to[out * inputs + in] = from[in * width_ + out];
    }

    int depth_, width_;
    size_t size_;
    AlignedFloats sums_;
};

// Runs `work(slice, begin, end, scratch)` for the slices of [0, count).
template <typename Work>
void in_slices(int threads, int32_t count, std::vector<AlignedFloats>& scratch, Work work) {
    in_parallel(threads, SLICES, 1, [&](int thread, int32_t slice, int32_t) {
        const auto begin = static_cast<int32_t>(static_cast<int64_t>(count) * slice / SLICES);
        const auto end = static_cast<int32_t>(static_cast<int64_t>(count) * (slice + 1) / SLICES);
        work(slice, begin, end, scratch[static_cast<size_t>(thread)].data());
    });
}

// The edges ordered by sender. Every edge has its reverse, so the groups start at the same places as those by receiver.
std::vector<int32_t> order_by_sender(const int64_t* starts, const int64_t* senders, int32_t count) {
    std::vector<int64_t> next(starts, starts + count);
    std::vector<int32_t> order(static_cast<size_t>(starts[count]));
    for (int64_t e = 0; e < starts[count]; ++e) {
        int64_t& place = next[static_cast<size_t>(senders[e])];
        if (place == starts[senders[e] + 1]) throw std::invalid_argument("an edge has no reverse");
        order[static_cast<size_t>(place++)] = static_cast<int32_t>(e);
    }
    return order;
}

}  // namespace

bool has_bfloat16(const Isa& isa) { return isa.bfloat16() != nullptr; }

void rows_forward(const Isa& isa, Precision first, Precision precision, RowPass pass, const PerceptronWeights& weights,
                  int32_t count, int threads) {
    const MessagePassingKernels& kernels = kernels_of(isa, precision);
    const PackedPerceptron packed(weights, first, precision, false);
    pass.perceptron = packed.view();
    auto scratch = scratch_of(threads, weights);
    require_first(first, precision);
    const auto run = first == precision ? kernels.rows_forward : kernels.features_forward;
    in_parallel(threads, count, PORTION, [&](int thread, int32_t begin, int32_t end) {
        run(pass, begin, end, scratch[static_cast<size_t>(thread)].data());
    });
}

void rows_backward(const Isa& isa, Precision first, Precision precision, RowPass pass, const PerceptronWeights& weights,
                   const PerceptronWeightsGradient& gradient, int32_t count, int threads) {
    const MessagePassingKernels& kernels = kernels_of(isa, precision);
    const PackedPerceptron packed(weights, first, precision, true);
    pass.perceptron = packed.view();
    auto scratch = scratch_of(threads, weights);
    GradientSlices slices(weights);
    require_first(first, precision);
    const auto run = first == precision ? kernels.rows_backward : kernels.features_backward;
    in_slices(threads, count, scratch,
              [&](int slice, int32_t begin, int32_t end, float* room) { run(pass, slices.slice(slice), begin, end, room); });
    slices.write(gradient);
}

void edges_forward(const Isa& isa, Precision precision, EdgePass pass, const PerceptronWeights& weights, int32_t count,
                   int threads) {
    const MessagePassingKernels& kernels = kernels_of(isa, precision);
    const PackedPerceptron packed(weights, precision, precision, false);
    pass.perceptron = packed.view();
    auto scratch = scratch_of(threads, weights);
    in_parallel(threads, count, PORTION, [&](int thread, int32_t begin, int32_t end) {
        kernels.edges_forward(pass, begin, end, scratch[static_cast<size_t>(thread)].data());
    });
}

void edges_backward(const Isa& isa, Precision precision, EdgePass pass, const PerceptronWeights& weights,
                    const PerceptronWeightsGradient& gradient, int32_t count, int threads) {
    const MessagePassingKernels& kernels = kernels_of(isa, precision);
    const PackedPerceptron packed(weights, precision, precision, true);
    pass.perceptron = packed.view();
    auto scratch = scratch_of(threads, weights);
    GradientSlices slices(weights);
    in_slices(threads, count, scratch, [&](int slice, int32_t begin, int32_t end, float* room) {
        kernels.edges_backward(pass, slices.slice(slice), begin, end, room);
    });
    const std::vector<int32_t> by_sender = order_by_sender(pass.starts, pass.senders, count);
    pass.by_sender = by_sender.data();
    in_parallel(threads, count, PORTION,
                [&](int, int32_t begin, int32_t end) { kernels.endpoints_backward(pass, begin, end); });
    slices.write(gradient);
}

}  // namespace surfsup
