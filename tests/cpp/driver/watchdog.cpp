// SPDX-License-Identifier: BSD-3-Clause
#include "driver/watchdog.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>

namespace orbslam::driver {

Watchdog::Watchdog(double patience_seconds)
    : patience_(patience_seconds), thread_([this] { watch(); }) {}

Watchdog::~Watchdog() {
  {
    const std::lock_guard lock(mutex_);
    done_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

Watchdog::Scope::Scope(Watchdog& watchdog, std::string operation, double factor)
    : watchdog_(watchdog) {
  const std::lock_guard lock(watchdog_.mutex_);
  number_ = watchdog_.next_++;
  watchdog_.running_[number_] = {std::move(operation), Clock::now(), factor};
}

Watchdog::Scope::~Scope() {
  const std::lock_guard lock(watchdog_.mutex_);
  const Operation operation = watchdog_.running_.at(number_);
  watchdog_.running_.erase(number_);
  const std::chrono::duration<double, std::milli> taken = Clock::now() - operation.begin;
  double& slowest = watchdog_.slowest_[operation.name];
  slowest = std::max(slowest, taken.count());
}

std::map<std::string, double> Watchdog::slowest() const {
  const std::lock_guard lock(mutex_);
  return slowest_;
}

void Watchdog::watch() {
  std::unique_lock lock(mutex_);
  while (!done_) {
    wake_.wait_for(lock, std::chrono::milliseconds(50));
    const auto now = Clock::now();
    for (const auto& [number, operation] : running_) {
      if (now - operation.begin <= operation.factor * patience_) continue;
      std::fprintf(stderr, "'%s' has not ended after %.1f s; running:\n", operation.name.c_str(),
                   operation.factor * patience_.count());
      for (const auto& [other, o] : running_) std::fprintf(stderr, "  %s\n", o.name.c_str());
      std::abort();
    }
  }
}

}  // namespace orbslam::driver
