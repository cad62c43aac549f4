// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <thread>

namespace orbslam::driver {

/// Ends the process, naming the operation, when one of the watched operations takes too long.
class Watchdog {
 public:
  explicit Watchdog(double patience_seconds);
  ~Watchdog();
  Watchdog(const Watchdog&) = delete;
  Watchdog& operator=(const Watchdog&) = delete;

  /// An operation under watch, from construction to destruction.
  class Scope {
   public:
    /// `factor`: multiplies the patience.
    Scope(Watchdog& watchdog, std::string operation, double factor = 1);
    ~Scope();
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    Watchdog& watchdog_;
    std::uint64_t number_;
  };

  /// The slowest of each operation so far, in milliseconds.
  std::map<std::string, double> slowest() const;

 private:
  using Clock = std::chrono::steady_clock;
  struct Operation {
    std::string name;
    Clock::time_point begin;
    double factor = 1;
  };
  void watch();

  const std::chrono::duration<double> patience_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::map<std::uint64_t, Operation> running_;
  std::map<std::string, double> slowest_;
  std::uint64_t next_ = 0;
  bool done_ = false;
  std::thread thread_;
};

}  // namespace orbslam::driver
