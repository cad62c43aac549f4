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

/// Threads beside the caller's; the destructor waits for them.
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

/// Calls work(i) once for each i = 0 .. n - 1, in no particular order. It uses `n_threads` threads,
/// the caller's included, or fewer if the system gives no more. After an exception no further call
/// is begun. Of several exceptions that of the lowest i is thrown, for any number of threads.
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
        // All lower calls have begun before this one, so the lowest one that fails is found.
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
