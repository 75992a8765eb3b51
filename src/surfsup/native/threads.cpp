#include "threads.hpp"

#include <algorithm>
#include <atomic>

#include <dlfcn.h>

namespace surfsup {
namespace {

// A second pool beside torch's would fight it for the cores: threads that have done their share spin for
// milliseconds in wait of more. So nothing is linked; the runtime is looked for in the process (GNU's, or LLVM's,
// which answers to the same names). These two are what a compiler itself emits for `#pragma omp parallel`.
using Parallel = void (*)(void (*)(void*), void*, unsigned, unsigned);

Parallel find_parallel() { return reinterpret_cast<Parallel>(dlsym(RTLD_DEFAULT, "GOMP_parallel")); }

struct Job {
    const std::function<void(int, int32_t, int32_t)>& work;
    int32_t count, portion;
    std::atomic<int64_t> next{0};
    std::atomic<int> threads{0};

    // A portion at a time, so that a thread that has to wait for its core holds up nobody.
    void take_part() {
        const int thread = threads.fetch_add(1);
        for (int64_t begin; (begin = next.fetch_add(portion)) < count;)
            work(thread, static_cast<int32_t>(begin), static_cast<int32_t>(std::min<int64_t>(count, begin + portion)));
    }
};

}  // namespace

bool can_thread() { return find_parallel() != nullptr; }

void in_parallel(int threads, int32_t count, int32_t portion, const std::function<void(int, int32_t, int32_t)>& work) {
    const Parallel parallel = threads > 1 && count > portion ? find_parallel() : nullptr;
    Job job{work, count, portion};
    if (parallel)
        parallel([](void* data) { static_cast<Job*>(data)->take_part(); }, &job, static_cast<unsigned>(threads), 0);
    else
        job.take_part();
}

}  // namespace surfsup
