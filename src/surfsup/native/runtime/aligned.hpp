// Memory aligned to cache lines: a vector across two lines costs two accesses.
#pragma once

#include <cstdlib>
#include <new>
#include <vector>

#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace surfsup {

constexpr size_t LINE = 64, HUGE_PAGE = 1 << 21;

inline void* take_aligned(size_t bytes) {
    const size_t alignment = bytes < HUGE_PAGE ? LINE : HUGE_PAGE;
    const size_t size = (bytes + alignment - 1) / alignment * alignment;
    void* memory = std::aligned_alloc(alignment, size);
#if defined(__linux__)
    // Large pages save TLB misses. The system may ignore the advice.
    if (memory && alignment == HUGE_PAGE) madvise(memory, size, MADV_HUGEPAGE);
#endif
    return memory;
}

template <typename Value>
struct Aligned {
    using value_type = Value;
    Aligned() = default;
    template <typename Other>
    Aligned(const Aligned<Other>&) {}
    Value* allocate(size_t count) {
        void* memory = take_aligned(count * sizeof(Value));
        if (!memory) throw std::bad_alloc();
        return static_cast<Value*>(memory);
    }
    void deallocate(Value* memory, size_t) { std::free(memory); }
    bool operator==(const Aligned&) const { return true; }
    bool operator!=(const Aligned&) const { return false; }
};

using AlignedFloats = std::vector<float, Aligned<float>>;

}  // namespace surfsup
