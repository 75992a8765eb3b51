#include "runtime/arena.hpp"

#include <algorithm>

#include "isa/isa.hpp"
#include "runtime/aligned.hpp"

namespace surfsup {

void Arena::reset() { current_ = 0, used_ = 0; }

void* Arena::take(int64_t bytes) {
    bytes = (bytes + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    while (current_ < chunks_.size() && used_ + bytes > chunks_[current_].size) ++current_, used_ = 0;
    if (current_ == chunks_.size()) {
        const int64_t size = std::max(CHUNK, bytes);
        auto* memory = static_cast<char*>(take_aligned(static_cast<size_t>(size)));
        if (!memory) return nullptr;
        chunks_.push_back({std::unique_ptr<char, Free>(memory), size});
        used_ = 0;
    }
    void* piece = chunks_[current_].memory.get() + used_;
    used_ += bytes;
    return piece;
}

void* take(Arena& arena, int64_t bytes) { return arena.take(bytes); }

}  // namespace surfsup
