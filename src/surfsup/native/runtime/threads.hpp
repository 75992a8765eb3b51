// A thread pool in which the caller takes part and never waits for an idle helper.
#pragma once

#include <cstdint>
#include <functional>

namespace surfsup {

// Runs `work(thread, begin, end)` over [0, count) in portions of `portion`, on up to `threads` threads. The caller is thread 0.
// A free thread takes the next portion.
void in_parallel(int threads, int32_t count, int32_t portion, const std::function<void(int, int32_t, int32_t)>& work);

}  // namespace surfsup
