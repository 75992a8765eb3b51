// Memory of one thread for the duration of a frame.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <vector>

namespace surfsup {

// Allocates pieces of large chunks. `reset` frees all pieces and keeps the chunks: fresh memory from the system costs a page
// fault every 4 KB.
class Arena {
public:
    void* take(int64_t bytes);
    void reset();

private:
    static constexpr int64_t CHUNK = 1 << 21, ALIGNMENT = 64;
    struct Free {
        void operator()(char* memory) const { std::free(memory); }
    };
    struct Chunk {
        std::unique_ptr<char, Free> memory;
        int64_t size;
    };
    std::vector<Chunk> chunks_;
    size_t current_ = 0;
    int64_t used_ = 0;
};

}  // namespace surfsup
