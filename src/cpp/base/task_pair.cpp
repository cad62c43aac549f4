// SPDX-License-Identifier: BSD-3-Clause
#include "base/task_pair.hpp"

#include <chrono>

namespace orbslam {
namespace {

/// How long the helper looks for the next pair before it sleeps.
constexpr std::chrono::microseconds patience{200};

}  // namespace

TaskPair::TaskPair() : helper_([this] { help(); }) {}

TaskPair::~TaskPair() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  changed_.notify_one();
  helper_.join();
}

void TaskPair::offer(Call call, const void* work) {
  call_ = call;
  work_ = work;
  state_ = State::kOffered;  // all in one order with asleep_: one of the two sees the other
  if (!asleep_) return;
  { const std::lock_guard lock(mutex_); }  // the helper waits
  changed_.notify_one();
}

bool TaskPair::take_back() {
  State offered = State::kOffered;
  return state_.compare_exchange_strong(offered, State::kNothing);
}

void TaskPair::wait_until_done() {
  while (state_ != State::kDone) std::this_thread::yield();
  state_ = State::kNothing;
}

/// True when the helper has taken work, false when the pair ends.
bool TaskPair::look_for_work() {
  const auto take = [this] {
    State offered = State::kOffered;
    return state_.compare_exchange_strong(offered, State::kTaken);
  };
  const auto until = std::chrono::steady_clock::now() + patience;
  while (!ended_ && std::chrono::steady_clock::now() < until) {
    if (take()) return true;
    std::this_thread::yield();
  }
  bool taken = false;
  std::unique_lock lock(mutex_);
  asleep_ = true;
  changed_.wait(lock, [&] { return ended_ || (taken = take()); });
  asleep_ = false;
  return taken;
}

void TaskPair::help() {
  while (look_for_work()) {
    call_(work_, 1);
    state_ = State::kDone;
  }
}

}  // namespace orbslam
