// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <type_traits>

namespace orbslam {

/// Two tasks at a time for two threads: the caller's and a helper. For many short pairs one right
/// after the other: between them the helper looks for the next one before it sleeps, since waking
/// it for each would take away what it brings. On a busy computer, where the helper does not come,
/// the caller does both; nothing is waited for that has not begun.
class TaskPair {
 public:
  TaskPair();
  /// No pair may be running.
  ~TaskPair();
  TaskPair(const TaskPair&) = delete;
  TaskPair& operator=(const TaskPair&) = delete;

  /// Calls work(0) and work(1), at the same time if the helper comes; both are done on return. One
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
