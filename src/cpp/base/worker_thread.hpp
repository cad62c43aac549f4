// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>

namespace orbslam {

/// One helper thread that lives as long as its owner and runs one job at a time. Starting a job
/// costs a wake-up, not a new thread. One owner at a time calls start() and finish().
class WorkerThread {
 public:
  WorkerThread();
  /// Waits for a running job; its exception is dropped.
  ~WorkerThread();
  WorkerThread(const WorkerThread&) = delete;
  WorkerThread& operator=(const WorkerThread&) = delete;

  /// Runs the job in the helper thread. Throws StateError while an earlier job has not been
  /// finished.
  void start(std::function<void()> job);
  /// Waits for the job and throws what it threw. Without a job it returns at once.
  void finish();

 private:
  void run();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::function<void()> job_;  // empty: nothing to run
  bool started_ = false;       // from start() to finish()
  bool done_ = false;
  bool stop_ = false;
  std::exception_ptr exception_;
  std::thread thread_;  // last: it uses the members above
};

}  // namespace orbslam
