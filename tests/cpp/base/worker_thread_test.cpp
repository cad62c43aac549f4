// SPDX-License-Identifier: BSD-3-Clause
#include "base/worker_thread.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "base/errors.hpp"

namespace orbslam {
namespace {

TEST(WorkerThread, RunsEveryJobInOneOtherThread) {
  WorkerThread helper;
  std::thread::id first;
  helper.start([&] { first = std::this_thread::get_id(); });
  helper.finish();
  EXPECT_NE(first, std::this_thread::get_id());
  int sum = 0;
  for (int i = 1; i <= 500; ++i) {
    std::thread::id id;
    helper.start([&] {
      sum += i;
      id = std::this_thread::get_id();
    });
    helper.finish();
    ASSERT_EQ(id, first);
  }
  EXPECT_EQ(sum, 500 * 501 / 2);
}

TEST(WorkerThread, WorksWhileTheCallerWorks) {
  WorkerThread helper;
  std::atomic<int> step{0};
  helper.start([&] {
    while (step != 1) std::this_thread::yield();
    step = 2;
  });
  step = 1;
  while (step != 2) std::this_thread::yield();
  helper.finish();
  EXPECT_EQ(step, 2);
}

TEST(WorkerThread, ExceptionsArriveAtFinishAndLeaveItUsable) {
  WorkerThread helper;
  helper.start([] { throw ImageError("wrong"); });
  EXPECT_THROW(helper.finish(), ImageError);
  helper.finish();  // nothing left to report
  bool ran = false;
  helper.start([&] { ran = true; });
  helper.finish();
  EXPECT_TRUE(ran);
}

TEST(WorkerThread, ASecondJobBeforeTheFirstIsFinishedIsAStateError) {
  WorkerThread helper;
  int runs = 0;
  helper.start([&] { ++runs; });
  EXPECT_THROW(helper.start([&] { ++runs; }), StateError);
  helper.finish();
  EXPECT_EQ(runs, 1);
}

TEST(WorkerThread, DestructionWaitsForTheJob) {
  std::atomic<bool> ended{false};
  {
    WorkerThread helper;
    helper.start([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      ended = true;
    });
  }
  EXPECT_TRUE(ended);
  { const WorkerThread idle; }
}

}  // namespace
}  // namespace orbslam
