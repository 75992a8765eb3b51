#include "runtime/threads.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <system_error>
#include <thread>

namespace surfsup {
namespace {

using Work = std::function<void(int, int32_t, int32_t)>;
using Clock = std::chrono::steady_clock;

// How long a helper spins in wait of the next loop. A frame consists of many short loops; spinning longer would take the core
// from other threads.
constexpr auto AWAKE = std::chrono::microseconds(50);

void run_alone(int32_t count, int32_t portion, const Work& work) {
    for (int64_t begin = 0; begin < count; begin += portion)
        work(0, static_cast<int32_t>(begin), static_cast<int32_t>(std::min<int64_t>(count, begin + portion)));
}

// An OpenMP loop ends when all of its threads have finished, even those that never got a core; on a busy machine every short
// loop then costs a scheduler turn. Here the caller works until no portion is left and waits only for helpers within a portion.
// After a fork there are no helpers, and the caller does everything.
class Pool {
public:
    void run(int threads, int32_t count, int32_t portion, const Work& work) {
        const std::unique_lock<std::mutex> mine(running_, std::try_to_lock);
        if (!mine) {  // another loop uses the helpers
            run_alone(count, portion, work);
            return;
        }
        hire(threads - 1);
        work_ = &work, count_ = count, portion_ = portion, threads_ = threads;
        next_ = 0;
        {
            const std::lock_guard<std::mutex> lock(sleeping_);
            open_ = true;
        }
        wake_.notify_all();
        take_portions(0);
        open_ = false;
        wait_for_helpers();
    }

private:
    void hire(int helpers) {
        try {
            for (; helpers_ < helpers; ++helpers_) std::thread(&Pool::help, this, helpers_ + 1).detach();
        } catch (const std::system_error&) {
            // The system allows no more threads; the existing ones suffice.
        }
    }

    void help(int thread) {
        for (;;) {
            wait_for_work();
            // Announce first, then check: either the caller sees this helper, or the helper sees that the loop is closed.
            ++inside_;
            if (open_ && thread < threads_) take_portions(thread);
            if (--inside_ == 0 && !open_) {
                const std::lock_guard<std::mutex> lock(sleeping_);
                left_.notify_one();
            }
            if (thread >= threads_) std::this_thread::sleep_for(AWAKE);
        }
    }

    // Spins first, since a portion is short; then sleeps, since the helper may be waiting for this very core.
    void wait_for_helpers() {
        const auto enough = Clock::now() + AWAKE;
        while (inside_ > 0 && Clock::now() < enough) continue;
        if (inside_ == 0) return;
        std::unique_lock<std::mutex> lock(sleeping_);
        left_.wait(lock, [this] { return inside_ == 0; });
    }

    void wait_for_work() {
        const auto enough = Clock::now() + AWAKE;
        while (Clock::now() < enough)
            if (open_ && next_ < count_) return;
        std::unique_lock<std::mutex> lock(sleeping_);
        wake_.wait(lock, [this] { return open_ && next_ < count_; });
    }

    void take_portions(int thread) {
        for (int64_t begin; (begin = next_.fetch_add(portion_)) < count_;)
            (*work_)(thread, static_cast<int32_t>(begin), static_cast<int32_t>(std::min<int64_t>(count_, begin + portion_)));
    }

    std::mutex running_, sleeping_;
    std::condition_variable wake_, left_;
    int helpers_ = 0;
    std::atomic<bool> open_{false};
    std::atomic<int> inside_{0}, threads_{0};
    std::atomic<int64_t> next_{0};
    std::atomic<int64_t> count_{0};
    int32_t portion_ = 1;
    const Work* work_ = nullptr;
};

}  // namespace

void in_parallel(int threads, int32_t count, int32_t portion, const Work& work) {
    static Pool& pool = *new Pool;  // never destroyed: its threads end with the process
    if (threads > 1 && count > portion)
        pool.run(threads, count, portion, work);
    else
        run_alone(count, portion, work);
}

}  // namespace surfsup
