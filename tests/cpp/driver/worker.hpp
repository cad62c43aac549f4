// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "base/ids.hpp"
#include "base/stop_flag.hpp"

namespace orbslam::driver {

/// The worker of threads.py on std::thread: a queue, counted pauses, resets that are served in
/// every state, steps with a part off duty.
class Worker {
 public:
  using Step = std::function<void(KeyFrameId)>;

  Worker(std::string name, Step step);
  ~Worker() { finish(false); }
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  const std::string& name() const { return name_; }
  void start();
  /// `drain`: process what waits, unless a pause that may last is in force. Idempotent.
  void finish(bool drain);
  /// Drops what waits; waits until the running step leaves the map alone.
  void reset();
  void submit(KeyFrameId job);
  void interrupt() { interrupt_flag.set(); }
  /// Called by a step before its interruptible part: false when that part is not wanted.
  bool lower_interrupt();

  /// Holds the worker still from construction to destruction.
  class Pause {
   public:
    Pause(Worker& worker, bool brief);
    ~Pause() { release(); }
    Pause(Pause&& other) noexcept;
    Pause& operator=(Pause&&) = delete;
    void wait();
    void release();

   private:
    Worker* worker_;
    int lasting_;
  };

  /// A part of a step that leaves the map alone, from construction to destruction.
  class OffDuty {
   public:
    explicit OffDuty(Worker& worker);
    ~OffDuty();
    OffDuty(const OffDuty&) = delete;
    OffDuty& operator=(const OffDuty&) = delete;

   private:
    Worker& worker_;
  };

  bool pausing() const;
  bool idle() const;
  std::size_t n_waiting() const;
  /// Waits until all jobs are done; false when a pause that may last came between.
  bool wait_until_idle();
  /// Waits while more than `at_most` jobs wait, or a brief pause lasts.
  void wait_until_waiting(std::size_t at_most);

  StopFlag interrupt_flag, cancel_flag, waiting_flag;

 private:
  void run();
  bool leaves_map_alone() const { return !busy_ || off_duty_; }

  const std::string name_;
  const Step step_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<KeyFrameId> queue_;
  bool busy_ = false, off_duty_ = false, finish_requested_ = false;
  int pauses_ = 0, holds_ = 0;
  std::thread thread_;
};

}  // namespace orbslam::driver
