// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>

namespace orbslam {

/// The smoothed grey values around a keypoint in a level of its image pyramid. They cover the 9 x 9
/// pixels that align_patch compares, also when these are turned, stretched or enlarged. A patch
/// keeps no reference to its image.
struct ReferencePatch {
  static constexpr int kSize = 24;
  static constexpr int kCentre = 12;  ///< row and column of the pixel nearest to the keypoint

  /// 16 times the grey value, smoothed with the binomial filter (1 2 1) x (1 2 1) / 16.
  std::array<std::array<std::uint16_t, kSize>, kSize> values;
  Eigen::Vector2f fraction;  ///< keypoint minus that pixel, -0.5 to 0.5
};

/// Cuts the patch around `position` (x, y) [pixels of `level`], an image of 8 bits. False, and the
/// patch is of no use, when the position is not finite or too near to the border: at least 13
/// pixels must be on each side.
bool cut_patch(const cv::Mat& level, const Eigen::Vector2d& position, ReferencePatch& patch);

}  // namespace orbslam
