// SPDX-License-Identifier: BSD-3-Clause
#include "base/worker_thread.hpp"

#include <utility>

#include "base/errors.hpp"

namespace orbslam {

WorkerThread::WorkerThread() : thread_([this] { run(); }) {}

WorkerThread::~WorkerThread() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void WorkerThread::start(std::function<void()> job) {
  {
    const std::lock_guard lock(mutex_);
    if (started_) {
      throw StateError("the helper thread is busy; one caller at a time, each with its own helper");
    }
    job_ = std::move(job);
    started_ = true;
    done_ = false;
  }
  changed_.notify_all();
}

void WorkerThread::finish() {
  std::exception_ptr exception;
  {
    std::unique_lock lock(mutex_);
    if (!started_) return;
    changed_.wait(lock, [this] { return done_; });
    started_ = false;
    exception = std::exchange(exception_, nullptr);
  }
  if (exception) std::rethrow_exception(exception);
}

void WorkerThread::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stop_ || job_; });
    if (!job_) return;
    const std::function<void()> job = std::exchange(job_, nullptr);
    lock.unlock();
    std::exception_ptr exception;
    try {
      job();
    } catch (...) {
      exception = std::current_exception();
    }
    lock.lock();
    exception_ = std::move(exception);
    done_ = true;
    changed_.notify_all();
  }
}

}  // namespace orbslam
