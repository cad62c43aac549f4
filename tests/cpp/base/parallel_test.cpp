// SPDX-License-Identifier: BSD-3-Clause
#include "base/parallel.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>

#include <atomic>
#include <cstdlib>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "support/no_new_threads.hpp"

namespace orbslam {
namespace {

using ::testing::Each;

/// OMP_NUM_THREADS for a while; nullptr: not set.
class Wanted {
 public:
  explicit Wanted(const char* text) {
    if (const char* before = std::getenv(kName)) before_ = before;
    set(text);
  }
  ~Wanted() { set(before_ ? before_->c_str() : nullptr); }

 private:
  static constexpr const char* kName = "OMP_NUM_THREADS";
  static void set(const char* text) {
    if (text) {
      setenv(kName, text, 1);
    } else {
      unsetenv(kName);
    }
  }
  std::optional<std::string> before_;
};

/// This process may use so many cores, where it had as many, for a while.
class Cores {
 public:
  explicit Cores(int n) {
    sched_getaffinity(0, sizeof before_, &before_);
    cpu_set_t fewer;
    CPU_ZERO(&fewer);
    for (int cpu = 0; cpu < CPU_SETSIZE && n > 0; ++cpu) {
      if (!CPU_ISSET(cpu, &before_)) continue;
      CPU_SET(cpu, &fewer);
      --n;
    }
    sched_setaffinity(0, sizeof fewer, &fewer);
  }
  ~Cores() { sched_setaffinity(0, sizeof before_, &before_); }

 private:
  cpu_set_t before_;
};

std::vector<int> counts_of(std::size_t n, std::size_t n_threads) {
  std::vector<std::atomic<int>> counts(n);
  for_each_in_parallel(n, n_threads, [&](std::size_t i) { ++counts[i]; });
  return {counts.begin(), counts.end()};
}

TEST(ThreadsFor, NoMoreThanThereIsWorkFor) {
  const Wanted wanted(nullptr);
  EXPECT_EQ(threads_for(0), 1U);
  EXPECT_EQ(threads_for(1), 1U);
}

TEST(ThreadsFor, OneACoreOfThisProcess) {
  const Wanted wanted(nullptr);
  const std::size_t all = threads_for(100000);
  EXPECT_GE(all, 1U);
  const Cores one(1);
  EXPECT_EQ(threads_for(100000), 1U);
}

TEST(ThreadsFor, AsManyAsAreWanted) {
  const std::size_t all = [] {
    const Wanted wanted(nullptr);
    return threads_for(100000);
  }();
  for (const char* one : {"1", " 1 ", "1,4", "01"}) {
    const Wanted wanted(one);
    EXPECT_EQ(threads_for(100000), 1U) << one;
  }
  for (const char* none : {"", " ", "0", "-1", "two", "1x", "1000000", "99999999999999999999999"}) {
    const Wanted wanted(none);
    EXPECT_EQ(threads_for(100000), all) << none;
  }
}

TEST(ForEachInParallel, DoesAllOnce) {
  for (const std::size_t n : {0U, 1U, 2U, 5U, 1000U}) {
    for (const std::size_t n_threads : {0U, 1U, 2U, 7U}) {
      EXPECT_THAT(counts_of(n, n_threads), Each(1));
    }
  }
}

TEST(ForEachInParallel, TheCallersThreadIsOneOfThem) {
  std::atomic<int> present{0};
  std::vector<std::thread::id> ids(2);
  for_each_in_parallel(2, 2, [&](std::size_t i) {
    ids[i] = std::this_thread::get_id();
    ++present;
    while (present < 2) std::this_thread::yield();
  });
  EXPECT_NE(ids[0], ids[1]);
  EXPECT_TRUE(ids[0] == std::this_thread::get_id() || ids[1] == std::this_thread::get_id());
  for_each_in_parallel(2, 1, [&](std::size_t i) { ids[i] = std::this_thread::get_id(); });
  EXPECT_THAT(ids, Each(std::this_thread::get_id()));
}

TEST(ForEachInParallel, WithoutAnotherThreadTheCallerDoesAll) {
  const testing::NoNewThreads none;
  EXPECT_THROW(std::thread([] {}).join(), std::system_error);
  EXPECT_THAT(counts_of(1000, 8), Each(1));
}

TEST(ForEachInParallel, GoesOnWithTheThreadsItGot) {
  // Whoever comes first sees to it that no more can be started.
  std::optional<testing::NoNewThreads> none;
  std::once_flag first;
  std::atomic<int> done{0};
  for_each_in_parallel(64, 64, [&](std::size_t) {
    std::call_once(first, [&] { none.emplace(); });
    ++done;
  });
  EXPECT_EQ(done, 64);
}

TEST(ForEachInParallel, ThrowsTheFirstExceptionInOrderAndEndsTheRest) {
  for (const std::size_t n_threads : {1U, 2U, 4U}) {
    for (int trial = 0; trial < 50; ++trial) {
      std::atomic<int> n_done{0};
      std::string what;
      try {
        for_each_in_parallel(100000, n_threads, [&](std::size_t i) {
          ++n_done;
          if (i >= 3) throw std::runtime_error(std::to_string(i));
        });
      } catch (const std::runtime_error& error) {
        what = error.what();
      }
      // All before it have begun before it, in whatever thread.
      EXPECT_EQ(what, "3");
      EXPECT_LT(n_done, 20);
    }
  }
}

}  // namespace
}  // namespace orbslam
