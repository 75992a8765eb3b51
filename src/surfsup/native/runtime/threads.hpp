// A few threads of our own that help the caller, and for whom it never waits in vain.
#pragma once

#include <cstdint>
#include <functional>

namespace surfsup {

// Runs `work(thread, begin, end)` over [0, count) in portions of about `portion`, on up to `threads` threads; the
// caller is thread 0. Whoever is free takes the next portion.
void in_parallel(int threads, int32_t count, int32_t portion, const std::function<void(int, int32_t, int32_t)>& work);

}  // namespace surfsup
