// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "base/pose.hpp"
#include "frame/frame.hpp"

namespace orbslam {

inline constexpr int kSpreadColumns = 8;  ///< cells of the image that inliers are counted in
inline constexpr int kSpreadRows = 6;
/// Cells that the classical covariance counts as beside the cluster-robust one.
inline constexpr int kPriorCells = 12;

/// Distribution of a pose's inliers over the image, and the cluster-robust covariance from it.
struct InlierSpread {
  int cells = 0;    ///< of kSpreadColumns x kSpreadRows that hold an inlier
  int octaves = 0;  ///< of depth that hold one: [1, 2), [2, 4), [4, 8)... of the map's units
  /// Cluster-robust covariance of the pose (rotation, translation; left perturbation): residuals
  /// within a cell may have errors in common, as those of a wrong point or of a region that moves.
  /// Zero where it is not determined.
  Matrix6d covariance = Matrix6d::Zero();
};

/// Over the associated keypoints that are no outliers; no cells without any. Throws StateError when
/// the frame has no pose.
///
/// The covariance is the sandwich H^-1 (sum of g_c g_c') H^-1 over the cells c, with the gradient
/// g_c of a cell's residuals and the normal matrix H (K.-Y. Liang and S. Zeger, "Longitudinal Data
/// Analysis Using Generalized Linear Models", Biometrika 1986). With few cells their scatter is
/// poorly known. Therefore the classical covariance counts as kPriorCells further cells, and the
/// six unknowns of the pose are subtracted. See docs/method/tracking.md#stated-covariance.
InlierSpread spread_of_inliers(const TrackedFrame& frame);

/// Number of these keypoints whose points are still in the image of a camera at `T_nw`. See
/// docs/method/tracking.md#new-keyframes.
int count_staying(const TrackedFrame& frame, const Pose& T_nw);

/// Median distance [pixels] between the pixels of these keypoints' points in the frame and in a
/// camera at `T_nw`. Points behind either camera are left out; 0 without points. Throws StateError
/// when the frame has no pose.
double median_displacement(const TrackedFrame& frame, const Pose& T_nw);

}  // namespace orbslam
