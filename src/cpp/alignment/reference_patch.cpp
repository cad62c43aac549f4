// SPDX-License-Identifier: BSD-3-Clause
#include "alignment/reference_patch.hpp"

#include <cmath>

#include "alignment/smooth.hpp"

namespace orbslam {

bool cut_patch(const cv::Mat& level, const Eigen::Vector2d& position, ReferencePatch& patch) {
  constexpr int kBefore = ReferencePatch::kCentre + 1;
  constexpr int kAfter = ReferencePatch::kSize - ReferencePatch::kCentre;
  // Comparisons with NaN are false.
  if (!(position.x() >= kBefore && position.x() <= level.cols - 1 - kBefore &&
        position.y() >= kBefore && position.y() <= level.rows - 1 - kBefore)) {
    return false;
  }
  static_assert(kAfter <= kBefore);
  const int x = static_cast<int>(std::lround(position.x()));
  const int y = static_cast<int>(std::lround(position.y()));
  patch.fraction = (position - Eigen::Vector2d(x, y)).cast<float>();
  const std::uint8_t* begin = level.ptr<std::uint8_t>(y - kBefore) + (x - kBefore);
  alignment::smooth<ReferencePatch::kSize>(begin, static_cast<std::ptrdiff_t>(level.step[0]),
                                           patch.values);
  return true;
}

}  // namespace orbslam
