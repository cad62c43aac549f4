// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "frame/frame.hpp"

namespace orbslam {

inline constexpr int kSpreadColumns = 8;  ///< cells of the image that inliers are counted in
inline constexpr int kSpreadRows = 6;

/// How the keypoints that a pose was accepted with are spread.
struct InlierSpread {
  int cells = 0;    ///< of kSpreadColumns x kSpreadRows that hold one
  int octaves = 0;  ///< of depth that hold one: [1, 2), [2, 4), [4, 8)... of the map's units
  /// Variance of the residuals between these cells by that of all: 1 where neighbours are
  /// independent, more where they are wrong together. A covariance that takes them for independent
  /// is too small by this factor.
  double correlation = 1;
  double variance = 0;  ///< of these keypoints by their levels, mean [square pixels]; 0 without any
};

/// Over the associated keypoints that are no outliers; no cells without any. Throws StateError when
/// the frame has no pose. See docs/method/tracking.md#evidence.
InlierSpread spread_of_inliers(const TrackedFrame& frame);

/// How many of these keypoints show points that a camera at `T_nw` would still have in its image:
/// what is not about to leave the view. See docs/method/tracking.md#new-keyframes.
int count_staying(const TrackedFrame& frame, const Pose& T_nw);

/// Median distance in the image between where the points of these keypoints are and where a camera
/// at `T_nw` has them, pixels; what lies behind either is left out, 0 without any. Throws
/// StateError when the frame has no pose.
double median_displacement(const TrackedFrame& frame, const Pose& T_nw);

}  // namespace orbslam
