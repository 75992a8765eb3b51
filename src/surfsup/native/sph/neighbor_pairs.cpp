#include "sph/neighbor_pairs.hpp"

#include <algorithm>
#include <atomic>
#include <new>

#include "isa/isa.hpp"
#include "runtime/arena.hpp"
#include "runtime/threads.hpp"
#include "sph/cell_list.hpp"

namespace surfsup {
namespace {

constexpr int32_t PORTION = 48;          // particles
constexpr float SEARCH_SCALE = 1.0001f;  // of the radius: a search in single precision precedes the exact test

struct Senders {
    int32_t* indices = nullptr;
    int64_t count = 0;
};

// The exact squared distance of two particles.
double squared_distance(const float* positions, int64_t one, int64_t other) {
    double squared = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const double apart = static_cast<double>(positions[3 * other + axis]) - positions[3 * one + axis];
        squared += apart * apart;
    }
    return squared;
}

}  // namespace

NeighborPairs find_neighbor_pairs(const float* positions, int32_t count, double radius, int64_t max_pairs, int threads) {
    NeighborPairs pairs;
    SolverParameters parameters{};
    parameters.kernel_support = static_cast<float>(radius) * SEARCH_SCALE;
    CellList cells;
    if (count > 0 && !cells.sort(positions, count, parameters.kernel_support)) {
        pairs.count = -1;
        return pairs;
    }
    const int32_t* order = cells.order();
    std::vector<float> sorted[3];
    for (int axis = 0; axis < 3; ++axis) {
        sorted[axis].resize(static_cast<size_t>(count) + 16);
        for (int32_t i = 0; i < count; ++i)
            sorted[axis][static_cast<size_t>(i)] = positions[3 * static_cast<int64_t>(order[i]) + axis];
    }
    Frame frame{};
    frame.count = count;
    frame.parameters = &parameters;
    frame.cells = cells.cells();
    frame.x = sorted[0].data(), frame.y = sorted[1].data(), frame.z = sorted[2].data();

    const int workers = std::max(1, threads);
    const Isa& isa = *instruction_sets().front();
    std::vector<Arena> arenas(static_cast<size_t>(workers));
    std::vector<std::vector<char>> searches(static_cast<size_t>(workers),
                                            std::vector<char>(static_cast<size_t>(isa.sph->search_bytes)));
    std::vector<Senders> lists(static_cast<size_t>(count));
    std::atomic<int64_t> total{0};
    std::atomic<bool> enough_memory{true};
    in_parallel(workers, count, PORTION, [&](int thread, int32_t begin, int32_t end) {
        if (!enough_memory || total > max_pairs) return;
        const auto t = static_cast<size_t>(thread);
        int64_t here = 0;
        for (int32_t i = begin; i < end; ++i) {
            const int32_t* found = nullptr;
            const int64_t near = isa.sph->find_within(frame, i, arenas[t], searches[t].data(), found);
            auto* senders = near < 0 ? nullptr : static_cast<int32_t*>(arenas[t].take(4 * near));
            if (!senders) {
                enough_memory = false;
                return;
            }
            const int32_t caller = order[i];
            int64_t size = 0;
            for (int64_t k = 0; k < near; ++k)
                if (squared_distance(positions, caller, order[found[k]]) <= radius * radius) senders[size++] = order[found[k]];
            std::sort(senders, senders + size);
            lists[static_cast<size_t>(caller)] = {senders, size};
            here += size;
        }
        total += here;
    });
    if (!enough_memory) throw std::bad_alloc();
    pairs.count = total;
    if (total > max_pairs) return pairs;
    pairs.starts.resize(static_cast<size_t>(count) + 1);
    pairs.receivers.resize(static_cast<size_t>(total));
    pairs.senders.resize(static_cast<size_t>(total));
    int64_t at = 0;
    for (int32_t i = 0; i < count; ++i) {
        pairs.starts[static_cast<size_t>(i)] = at;
        const Senders& senders = lists[static_cast<size_t>(i)];
        for (int64_t k = 0; k < senders.count; ++k, ++at) {
            pairs.receivers[static_cast<size_t>(at)] = i;
            pairs.senders[static_cast<size_t>(at)] = senders.indices[k];
        }
    }
    pairs.starts.back() = at;
    return pairs;
}

}  // namespace surfsup
