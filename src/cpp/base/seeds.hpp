// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <initializer_list>

#include "base/mix.hpp"

namespace orbslam {

/// One seed out of several numbers (that of the system, ids): others for any other numbers or
/// order, the same on every platform.
inline std::uint64_t seed_of(std::initializer_list<std::uint64_t> numbers) {
  std::uint64_t state = 0;
  for (const std::uint64_t number : numbers) state = mix(state + number);
  return state;
}

}  // namespace orbslam
