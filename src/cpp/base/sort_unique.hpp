// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace orbslam {

/// Every id once, ascending. The ids of a neighbourhood lie close together and come up many times,
/// so that noting them is cheaper than sorting them.
template <class IdType>
void sort_unique(std::vector<IdType>& ids) {
  if (ids.empty()) return;
  const auto [first, last] = std::minmax_element(ids.begin(), ids.end());
  const auto lowest = first->value;
  const auto range = static_cast<std::size_t>(last->value - lowest) + 1;
  if (range > 64 * ids.size()) {
    std::sort(ids.begin(), ids.end());
    ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
    return;
  }
  std::vector<std::uint8_t> present(range, 0);
  for (const IdType id : ids) present[static_cast<std::size_t>(id.value - lowest)] = 1;
  ids.clear();
  for (std::size_t i = 0; i < range; ++i) {
    if (present[i] != 0) ids.push_back(IdType(lowest + static_cast<decltype(lowest)>(i)));
  }
}

}  // namespace orbslam
