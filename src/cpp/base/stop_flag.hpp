// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>

namespace orbslam {

/// A flag by which one thread asks another's long call to end early. Calls take the address of
/// value(); a null pointer there means "never".
class StopFlag {
 public:
  void set() { value_.store(true); }
  void clear() { value_.store(false); }
  bool is_set() const { return value_.load(); }
  const std::atomic<bool>& value() const { return value_; }

 private:
  std::atomic<bool> value_{false};
};

}  // namespace orbslam
