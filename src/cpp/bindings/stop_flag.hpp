// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <memory>

#include "base/stop_flag.hpp"

namespace orbslam::bindings {

/// What the core's long calls poll; nullptr for None.
inline const std::atomic<bool>* flag_of(const std::shared_ptr<StopFlag>& flag) {
  return flag ? &flag->value() : nullptr;
}

}  // namespace orbslam::bindings
