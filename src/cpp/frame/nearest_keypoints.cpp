// SPDX-License-Identifier: BSD-3-Clause
#include "frame/nearest_keypoints.hpp"

#include <algorithm>

namespace orbslam {

void nearest_keypoints(const Frame& frame, std::size_t n_minimum,
                       std::vector<std::uint32_t>& indices) {
  indices.clear();
  for (std::size_t i = 0; i < frame.size(); ++i) {
    if (frame.has_depth(i)) indices.push_back(static_cast<std::uint32_t>(i));
  }
  std::sort(indices.begin(), indices.end(), [&](std::uint32_t a, std::uint32_t b) {
    return frame.depth[a] != frame.depth[b] ? frame.depth[a] < frame.depth[b] : a < b;
  });
  // The first far one beyond the minimum is still taken: the original makes the point before it
  // asks whether there are enough, and its maps are to be comparable.
  for (std::size_t n = n_minimum; n < indices.size(); ++n) {
    const std::uint32_t i = indices[n];
    if (frame.depth[i] > frame.camera->close_depth(frame.keypoints[i].x)) {
      indices.resize(n + 1);
      return;
    }
  }
}

}  // namespace orbslam
