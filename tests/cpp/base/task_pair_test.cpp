// SPDX-License-Identifier: BSD-3-Clause
#include "base/task_pair.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <thread>

namespace orbslam {
namespace {

TEST(TaskPair, DoesBothTasksOfEveryPairOnce) {
  TaskPair pair;
  std::array<int, 2> sums{};
  for (int i = 1; i <= 5000; ++i) {
    pair.run([&](int number) noexcept { sums[static_cast<std::size_t>(number)] += i; });
    ASSERT_EQ(sums[0], sums[1]);
  }
  EXPECT_EQ(sums[0], 5000 * 5001 / 2);
}

TEST(TaskPair, WorksInTwoThreadsAtATime) {
  TaskPair pair;
  std::atomic<int> present{0};
  std::array<std::thread::id, 2> threads{};
  pair.run([&](int number) noexcept {
    threads[static_cast<std::size_t>(number)] = std::this_thread::get_id();
    ++present;
    // The first task waits for the second, which another thread must have begun.
    while (number == 0 && present < 2) std::this_thread::yield();
  });
  EXPECT_EQ(threads[0], std::this_thread::get_id());
  EXPECT_NE(threads[1], threads[0]);
}

TEST(TaskPair, AHelperThatSleepsIsWoken) {
  TaskPair pair;
  std::atomic<int> present{0};
  for (int i = 0; i < 3; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));  // longer than it stays awake
    present = 0;
    pair.run([&](int number) noexcept {
      ++present;
      while (number == 0 && present < 2) std::this_thread::yield();
    });
    EXPECT_EQ(present, 2);
  }
}

TEST(TaskPair, SeesWhatWasWrittenBeforeAndAfter) {
  TaskPair pair;
  std::array<int, 2> values{};  // not atomic
  int expected = 0;
  for (int i = 0; i < 2000; ++i) {
    pair.run([&](int number) noexcept { ++values[static_cast<std::size_t>(number)]; });
    ++expected;
    ASSERT_EQ(values[1], expected);
    values[1] += 2;
    expected += 2;
  }
}

TEST(TaskPair, EndsAwakeOrAsleep) {
  { const TaskPair pair; }
  {
    const TaskPair pair;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  TaskPair pair;
  std::atomic<int> n_done{0};
  pair.run([&](int) noexcept { ++n_done; });
  EXPECT_EQ(n_done, 2);
}

}  // namespace
}  // namespace orbslam
