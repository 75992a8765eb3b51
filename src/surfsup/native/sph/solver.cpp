#include "sph/solver.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <new>
#include <stdexcept>

#include "runtime/threads.hpp"

namespace surfsup {
namespace {

constexpr int MULTIPLE = 16;  // of channels: the widest isa's lanes
constexpr float FAR_AWAY = 1e6f;  // meters, where the particle is that fills up lists of neighbors

// (outputs, inputs) -> rows of `to`: an input a row, `to_width` wide, at column `first`.
void transpose(const Matrix& matrix, float* to, int64_t to_width, int64_t first = 0) {
    for (int64_t input = 0; input < matrix.inputs; ++input)
        for (int64_t output = 0; output < matrix.outputs; ++output)
            to[input * to_width + first + output] = matrix.values[output * matrix.inputs + input];
}

void expect(const Matrix& matrix, int64_t outputs, int64_t inputs, const char* name) {
    if (matrix.outputs != outputs || matrix.inputs != inputs)
        throw std::invalid_argument(std::string(name) + " is (" + std::to_string(matrix.outputs) + ", " +
                                    std::to_string(matrix.inputs) + "), but must be (" + std::to_string(outputs) +
                                    ", " + std::to_string(inputs) + ")");
}

}  // namespace

Network::Network(const Constants& constants, const SolidDensity& solids, Matrix encoder, Matrix factor_in,
                 const float* factor_in_bias, Matrix factor_out, const float* factor_out_bias,
                 const std::vector<Layer>& layers, Matrix decode_in, Matrix decode_out)
    : constants_(constants),
      solids_(solids),
      given_encoder_(encoder),
      given_factor_in_(factor_in),
      given_factor_out_(factor_out),
      given_decode_in_(decode_in),
      given_decode_out_(decode_out),
      given_factor_in_bias_(factor_in_bias),
      given_factor_out_bias_(factor_out_bias),
      given_layers_(layers) {
    const int64_t own = encoder.outputs, inner = factor_in.outputs;
    if (own < 1 || layers.empty()) throw std::invalid_argument("a network has at least one channel and one layer");
    expect(encoder, own, ACTIONS, "encoder.0");
    expect(factor_in, inner, SURROUNDINGS, "factors.0");
    expect(factor_out, 2 * own, inner, "factors.2");
    expect(decode_in, own, own, "decoder.0");
    expect(decode_out, OUTPUTS, own, "decoder.2");
    const int64_t told = layers.front().mix.inputs;
    if (told < 1 || told > own) throw std::invalid_argument("neighbors are told of one channel at least, of all at most");
    for (const Layer& layer : layers) {
        expect(layer.mix, KERNELS * own, told, "mix");
        expect(layer.own, own, own, "own");
        expect(layer.out, own, own, "out");
    }
    width_ = static_cast<int>((own + MULTIPLE - 1) / MULTIPLE * MULTIPLE);
    messages_ = static_cast<int>((told + MULTIPLE - 1) / MULTIPLE * MULTIPLE);
    factors_width_ = static_cast<int>((inner + MULTIPLE - 1) / MULTIPLE * MULTIPLE);
    layers_ = static_cast<int>(layers.size());
}

void Network::read_weights() {
    const int64_t own = given_encoder_.outputs, width = width_;
    encoder_.assign(static_cast<size_t>(ACTIONS * width), 0.0f);
    transpose(given_encoder_, encoder_.data(), width);
    decode_in_.assign(static_cast<size_t>(width * width), 0.0f);
    transpose(given_decode_in_, decode_in_.data(), width);
    const int64_t given_inner = given_factor_in_.outputs, inner = factors_width_;
    factor_in_.assign(static_cast<size_t>(SURROUNDINGS * inner), 0.0f);
    transpose(given_factor_in_, factor_in_.data(), inner);
    factor_in_bias_.assign(static_cast<size_t>(inner), 0.0f);
    std::copy_n(given_factor_in_bias_, given_inner, factor_in_bias_.begin());
    // The first and the last factors, each from a multiple of the lanes on.
    factor_out_.assign(static_cast<size_t>(inner * 2 * width), 0.0f);
    factor_out_bias_.assign(static_cast<size_t>(2 * width), 0.0f);
    for (int64_t half = 0; half < 2; ++half) {
        const Matrix matrix{given_factor_out_.values + half * own * given_inner, own, given_inner};
        transpose(matrix, factor_out_.data(), 2 * width, half * width);
        std::copy_n(given_factor_out_bias_ + half * own, own, factor_out_bias_.begin() + half * width);
    }
    const int64_t told = given_layers_.front().mix.inputs, messages = messages_, depth = KERNELS * messages + width;
    mix_.assign(static_cast<size_t>(layers_ * depth * width), 0.0f);
    out_.assign(static_cast<size_t>(layers_ * width * width), 0.0f);
    for (int64_t number = 0; number < layers_; ++number) {
        const Layer& layer = given_layers_[static_cast<size_t>(number)];
        float* mix = mix_.data() + number * depth * width;
        for (int64_t m = 0; m < KERNELS; ++m)
            transpose({layer.mix.values + m * own * told, own, told}, mix + m * messages * width, width);
        transpose(layer.own, mix + KERNELS * messages * width, width);
        transpose(layer.out, out_.data() + number * width * width, width);
    }
    decode_out_.assign(static_cast<size_t>(width * OUTPUT_ROOM), 0.0f);
    transpose(given_decode_out_, decode_out_.data(), OUTPUT_ROOM);
}

int64_t Network::look(const Fluid& fluid, const Isa& isa, int threads, int64_t most_edges, Frame& frame) {
    const auto count = static_cast<size_t>(fluid.count);
    read_weights();
    halfway_.resize(3 * count);
    for (size_t k = 0; k < 3 * count; ++k) halfway_[k] = 0.5f * (fluid.positions[k] + fluid.ahead[k]);
    const bool finite = cells_.sort(halfway_.data(), fluid.count, constants_.radius);
    const int32_t* order = cells_.order();
    for (auto* sorted : {&x_, &y_, &z_}) sorted->resize(count + MULTIPLE);
    motion_.resize(static_cast<size_t>(MOTION) * (count + 1));
    pushes_.resize(static_cast<size_t>(PUSH) * (count + 1));
    for (size_t i = 0; i < count; ++i) {
        const size_t caller = static_cast<size_t>(order[i]);
        x_[i] = halfway_[3 * caller];
        y_[i] = halfway_[3 * caller + 1];
        z_[i] = halfway_[3 * caller + 2];
        float* motion = &motion_[static_cast<size_t>(MOTION) * i];
        for (size_t axis = 0; axis < 3; ++axis) {
            motion[axis] = fluid.positions[3 * caller + axis];
            motion[4 + axis] = fluid.velocities[3 * caller + axis];
        }
        motion[3] = motion[7] = 0.0f;
    }
    float* beyond = &motion_[static_cast<size_t>(MOTION) * count];
    std::fill_n(beyond, 4, FAR_AWAY);
    std::fill_n(beyond + 4, 4, 0.0f);
    float* push_beyond = &pushes_[static_cast<size_t>(PUSH) * count];
    std::fill_n(push_beyond, 3, FAR_AWAY);
    push_beyond[3] = 0.0f;
    edges_.resize(count);
    sweeps_.resize(count);
    const size_t with_room = count + static_cast<size_t>(isa.rows);
    acts_.resize(with_room * ACTIONS);
    lie_.resize(with_room * SURROUNDINGS);

    frame.count = fluid.count;
    frame.constants = constants_;
    frame.solids = solids_;
    frame.weights = {width_, messages_, layers_, factors_width_, encoder_.data(), factor_in_.data(),
                     factor_in_bias_.data(), factor_out_.data(), factor_out_bias_.data(), mix_.data(), out_.data(),
                     decode_in_.data(), decode_out_.data()};
    frame.cells = cells_.cells();
    frame.order = order;
    frame.x = x_.data(), frame.y = y_.data(), frame.z = z_.data();
    frame.positions = fluid.positions, frame.velocities = fluid.velocities;
    frame.ahead = fluid.ahead, frame.distance = fluid.distance, frame.normal = fluid.normal;
    for (int axis = 0; axis < 3; ++axis) {
        frame.gravity[axis] = fluid.gravity[axis];
        frame.lower[axis] = fluid.lower[axis];
        frame.upper[axis] = fluid.upper[axis];
        const float size = fluid.upper[axis] - fluid.lower[axis];
        frame.cell[axis] = size / std::max(1.0f, std::nearbyint(size / solids_.wall_cell));
    }
    frame.map = fluid.map;
    frame.edges = edges_.data();
    frame.acts = acts_.data(), frame.lie = lie_.data();
    frame.sweeps = sweeps_.data();
    frame.motion = motion_.data(), frame.pushes = pushes_.data();

    const int most = std::max(1, threads);
    for (auto* arenas : {&arenas_, &searching_}) {
        arenas->resize(std::max(arenas->size(), static_cast<size_t>(most)));
        for (Arena& arena : *arenas) arena.reset();
    }
    searches_.assign(static_cast<size_t>(most), std::vector<char>(static_cast<size_t>(isa.search_bytes)));
    std::atomic<int64_t> edges{0};
    std::atomic<bool> enough{true};
    const int32_t portion = 4 * isa.rows;
    in_parallel(most, fluid.count, portion, [&](int thread, int32_t begin, int32_t end) {
        if (!enough || edges > most_edges) return;
        const auto t = static_cast<size_t>(thread);
        const int64_t found = isa.look(frame, begin, end, arenas_[t], searching_[t], searches_[t].data());
        found < 0 ? void(enough = false) : void(edges += found);
    });
    if (!enough) throw std::bad_alloc();
    if (edges > most_edges) return edges;
    for (int step = 0; step < constants_.steps; ++step) {
        in_parallel(most, fluid.count, portion, [&](int, int32_t begin, int32_t end) { isa.approach(frame, step, begin, end); });
        in_parallel(most, fluid.count, portion, [&](int, int32_t begin, int32_t end) { isa.leave(frame, step, begin, end); });
    }
    return finite ? edges.load() : -1;
}

int64_t Network::step(const Fluid& fluid, float* positions, float* velocities, const Isa& isa, int threads, int64_t most_edges) {
    const std::lock_guard<std::mutex> alone(stepping_);
    if (fluid.count == 0) return 0;
    Frame frame{};
    const int64_t edges = look(fluid, isa, threads, most_edges, frame);
    if (edges > most_edges) return edges;
    const auto count = static_cast<size_t>(fluid.count);
    for (auto* values : {&factors_, &hidden_[0], &hidden_[1]}) values->resize(count * static_cast<size_t>(width_));
    frame.factors = factors_.data();
    for (int which = 0; which < 2; ++which) {
        told_[which].resize(count * static_cast<size_t>(messages_));
        frame.hidden[which] = hidden_[which].data();
        frame.told[which] = told_[which].data();
    }
    frame.new_positions = positions, frame.new_velocities = velocities;
    const int most = std::max(1, threads);
    scratch_.resize(std::max(scratch_.size(), static_cast<size_t>(most)));
    for (auto& scratch : scratch_) scratch.resize(static_cast<size_t>(isa.scratch(frame)));
    const int32_t portion = 4 * isa.rows;
    in_parallel(most, fluid.count, portion, [&](int thread, int32_t begin, int32_t end) {
        isa.encode(frame, begin, end, scratch_[static_cast<size_t>(thread)].data());
    });
    for (int number = 0; number < layers_; ++number)
        in_parallel(most, fluid.count, portion, [&](int thread, int32_t begin, int32_t end) {
            isa.layer(frame, number, begin, end, scratch_[static_cast<size_t>(thread)].data());
        });
    in_parallel(most, fluid.count, portion, [&](int, int32_t begin, int32_t end) { isa.finish(frame, begin, end); });
    return edges;
}

int64_t Network::observe(const Fluid& fluid, const Told& told, const Isa& isa, int threads, int64_t most_edges) {
    const std::lock_guard<std::mutex> alone(stepping_);
    if (fluid.count == 0) return 0;
    Frame frame{};
    const int64_t edges = look(fluid, isa, threads, most_edges, frame);
    if (edges > most_edges) return edges;
    for (int64_t i = 0; i < fluid.count; ++i) {
        const int64_t caller = frame.order[i];
        std::copy_n(frame.acts + i * ACTIONS, ACTIONS, told.acts + caller * ACTIONS);
        std::copy_n(frame.lie + i * SURROUNDINGS, SURROUNDINGS, told.lie + caller * SURROUNDINGS);
        std::copy_n(frame.sweeps[i].faster, 3, told.faster + caller * 3);
        std::copy_n(frame.sweeps[i].farther, 3, told.farther + caller * 3);
        std::copy_n(frame.sweeps[i].slope, 3, told.slope + caller * 3);
        std::copy_n(frame.motion + i * MOTION, 3, told.places + caller * 3);
    }
    return edges;
}

std::vector<const Isa*> instruction_sets() {
    std::vector<const Isa*> found;
    for (const Isa* isa : {&avx512, &avx2, &plain})
        if (isa->supported()) found.push_back(isa);
    return found;
}

}  // namespace surfsup
