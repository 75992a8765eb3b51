// Threads: those of the OpenMP runtime that is loaded already, which in a process with torch is torch's own.
#pragma once

#include <cstdint>
#include <functional>

namespace surfsup {

// Whether there are threads to have at all; without them everything runs in the caller's.
bool can_thread();

// Runs `work(thread, begin, end)` over [0, count) in portions of about `portion`, on up to `threads` threads.
void in_parallel(int threads, int32_t count, int32_t portion, const std::function<void(int, int32_t, int32_t)>& work);

}  // namespace surfsup
