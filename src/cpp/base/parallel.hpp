// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace orbslam {

/// Threads for work that can be divided among `most`, at least 1: one a core of this process, and
/// no more than OMP_NUM_THREADS says. Batches set that to 1 in their workers, each of which has one
/// core; the Python side reads it in the same way (_cores.py).
std::size_t threads_for(std::size_t most);

/// Threads beside the caller's, which are waited for when it goes.
class HelperThreads {
 public:
  HelperThreads() = default;
  ~HelperThreads() {
    for (std::thread& thread : threads_) thread.join();
  }
  HelperThreads(const HelperThreads&) = delete;
  HelperThreads& operator=(const HelperThreads&) = delete;

  /// Calls work(), which must not throw, in `n` threads, or in as many as the system gives.
  template <class Work>
  void start(std::size_t n, const Work& work) {
    threads_.reserve(n);
    try {
      while (threads_.size() < n) threads_.emplace_back([&work] { work(); });
    } catch (const std::system_error&) {  // there are no more
    }
  }

 private:
  std::vector<std::thread> threads_;
};

/// Calls work(i) for i = 0 .. n - 1, each once, in no particular order, in `n_threads` threads of
/// which the caller's is one; fewer do the same where the system gives no more. An exception ends
/// the rest. Of several that of the lowest i is thrown, whatever the number of threads.
template <class Work>
void for_each_in_parallel(std::size_t n, std::size_t n_threads, const Work& work) {
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::exception_ptr failure;
  std::size_t failed = n;
  const auto take = [&] {
    for (std::size_t i = next++; i < n; i = next++) {
      try {
        work(i);
      } catch (...) {
        // All that are lower have begun before this one, so the lowest that fails is found.
        const std::lock_guard lock(mutex);
        if (i < failed) {
          failed = i;
          failure = std::current_exception();
        }
        next = n;
      }
    }
  };
  {
    HelperThreads helpers;
    const std::size_t n_useful = std::min(n_threads, n);
    if (n_useful > 1) helpers.start(n_useful - 1, take);
    take();
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace orbslam
