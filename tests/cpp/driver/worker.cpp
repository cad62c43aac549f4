// SPDX-License-Identifier: BSD-3-Clause
#include "driver/worker.hpp"

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <utility>

namespace orbslam::driver {

Worker::Worker(std::string name, Step step) : name_(std::move(name)), step_(std::move(step)) {}

void Worker::start() {
  thread_ = std::thread([this] { run(); });
}

void Worker::finish(bool drain) {
  {
    std::unique_lock lock(mutex_);
    if (drain) {
      changed_.wait(lock, [this] { return (queue_.empty() && !busy_) || holds_ > 0; });
    }
    finish_requested_ = true;
    queue_.clear();
    waiting_flag.clear();
    interrupt_flag.set();
    cancel_flag.set();
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void Worker::reset() {
  std::unique_lock lock(mutex_);
  queue_.clear();
  waiting_flag.clear();
  if (busy_) {
    interrupt_flag.set();
    cancel_flag.set();
  }
  changed_.notify_all();
  changed_.wait(lock, [this] { return leaves_map_alone(); });
}

void Worker::submit(KeyFrameId job) {
  {
    const std::lock_guard lock(mutex_);
    if (finish_requested_) return;
    queue_.push_back(job);
    waiting_flag.set();
    interrupt_flag.set();
  }
  changed_.notify_all();
}

bool Worker::lower_interrupt() {
  const std::lock_guard lock(mutex_);
  if (!queue_.empty() || pauses_ > 0 || finish_requested_ || cancel_flag.is_set()) return false;
  interrupt_flag.clear();
  return true;
}

Worker::Pause::Pause(Worker& worker, bool brief) : worker_(&worker), lasting_(brief ? 0 : 1) {
  const std::lock_guard lock(worker.mutex_);
  ++worker.pauses_;
  worker.holds_ += lasting_;
  worker.interrupt_flag.set();
  worker.changed_.notify_all();
}

Worker::Pause::Pause(Pause&& other) noexcept
    : worker_(std::exchange(other.worker_, nullptr)), lasting_(other.lasting_) {}

void Worker::Pause::wait() {
  std::unique_lock lock(worker_->mutex_);
  worker_->changed_.wait(lock, [this] { return worker_->leaves_map_alone(); });
}

void Worker::Pause::release() {
  if (!worker_) return;
  Worker& worker = *std::exchange(worker_, nullptr);
  const std::lock_guard lock(worker.mutex_);
  --worker.pauses_;
  worker.holds_ -= lasting_;
  worker.changed_.notify_all();
}

Worker::OffDuty::OffDuty(Worker& worker) : worker_(worker) {
  const std::lock_guard lock(worker_.mutex_);
  worker_.off_duty_ = true;
  worker_.changed_.notify_all();
}

Worker::OffDuty::~OffDuty() {
  std::unique_lock lock(worker_.mutex_);
  worker_.changed_.wait(lock,
                        [this] { return worker_.pauses_ == 0 || worker_.cancel_flag.is_set(); });
  worker_.off_duty_ = false;
}

bool Worker::pausing() const {
  const std::lock_guard lock(mutex_);
  return pauses_ > 0;
}

bool Worker::idle() const {
  const std::lock_guard lock(mutex_);
  return queue_.empty() && !busy_;
}

std::size_t Worker::n_waiting() const {
  const std::lock_guard lock(mutex_);
  return queue_.size();
}

bool Worker::wait_until_idle() {
  std::unique_lock lock(mutex_);
  const auto is_idle = [this] { return queue_.empty() && !busy_; };
  changed_.wait(lock, [&] { return is_idle() || holds_ > 0 || finish_requested_; });
  return is_idle();
}

void Worker::wait_until_waiting(std::size_t at_most) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] {
    return (pauses_ == 0 && queue_.size() <= at_most) || holds_ > 0 || finish_requested_;
  });
}

void Worker::run() {
  for (;;) {
    KeyFrameId job;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock,
                    [this] { return finish_requested_ || (pauses_ == 0 && !queue_.empty()); });
      if (finish_requested_) return;
      job = queue_.front();
      queue_.pop_front();
      busy_ = true;
      cancel_flag.clear();
      if (queue_.empty()) {
        waiting_flag.clear();
        interrupt_flag.clear();
      }
    }
    changed_.notify_all();
    try {
      step_(job);
    } catch (const std::exception& error) {
      std::fprintf(stderr, "%s failed: %s\n", name_.c_str(), error.what());
      std::abort();
    }
    {
      const std::lock_guard lock(mutex_);
      busy_ = false;
    }
    changed_.notify_all();
  }
}

}  // namespace orbslam::driver
