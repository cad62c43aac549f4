// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <type_traits>

namespace orbslam {

/// Runs two tasks at the same time in two threads: the caller's and a helper. It is made for many
/// short pairs in quick succession. After a pair the helper polls for the next one for a short time
/// before it sleeps, because waking it for each pair would cost more than it saves. If a busy
/// computer does not run the helper, the caller does both tasks. The caller never waits for a task
/// that has not begun.
class TaskPair {
 public:
  TaskPair();
  /// No pair may be running.
  ~TaskPair();
  TaskPair(const TaskPair&) = delete;
  TaskPair& operator=(const TaskPair&) = delete;

  /// Calls work(0) and work(1), at the same time if the helper runs; both are done on return. One
  /// caller at a time; `work` must not throw.
  template <class Work>
  void run(const Work& work) {
    static_assert(std::is_nothrow_invocable_v<const Work&, int>);
    offer([](const void* of, int number) { (*static_cast<const Work*>(of))(number); }, &work);
    work(0);
    if (take_back()) {
      work(1);
    } else {
      wait_until_done();
    }
  }

 private:
  enum class State { kNothing, kOffered, kTaken, kDone };
  using Call = void (*)(const void*, int);

  void offer(Call call, const void* work);
  bool take_back();
  void wait_until_done();
  void help();
  bool look_for_work();

  std::atomic<State> state_{State::kNothing};
  Call call_ = nullptr;
  const void* work_ = nullptr;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::atomic<bool> asleep_{false};
  std::atomic<bool> ended_{false};
  std::thread helper_;  // last: it uses the members above
};

}  // namespace orbslam
