// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "base/pose.hpp"
#include "frame/frame.hpp"

namespace orbslam {

/// One correspondence of a pose-only problem.
struct PoseObservation {
  Eigen::Vector3d position;   ///< world
  double u = 0, v = 0;        ///< undistorted pixels
  double right_u = 0;         ///< only if has_depth
  double inverse_sigma2 = 1;  ///< of the keypoint's level
  bool has_depth = false;
  double right_factor = 1;  ///< inverse variance of the right column over that of u and v
};

/// Gaussian of a pose: `T_cw = exp(e) mean` with `e` (rotation, translation) of mean zero.
struct PosePrior {
  Pose mean;                                ///< T_cw
  Matrix6d information = Matrix6d::Zero();  ///< inverse of the covariance of `e`
};

struct PoseEstimate {
  Pose T_cw;
  int n_inliers = 0;
  std::vector<std::uint8_t> outlier;  ///< per observation
  /// Covariance of T_cw in the tangent order (rotation, translation), left perturbation, scaled by
  /// the residual variance; zero when nothing was estimated. With a prior: of both together.
  Matrix6d covariance = Matrix6d::Zero();
  int iterations = 0;
};

/// Pose of a frame from fixed points: four rounds of at most ten iterations of damped Gauss-Newton,
/// each from the initial pose with a Huber kernel (off in the last) and without the outliers of the
/// round before; all are re-classified after each at 5.991 (two residuals) and 7.815 (three); a
/// point that is not in front of the camera is an outlier. Fewer than 10 observations, or fewer
/// than 3 inliers left: no further round. Fewer than 3 observations: returned unchanged, 0 inliers.
/// Observations with NaN or infinite numbers are outliers and take no part. See
/// docs/method/adjustment.md#pose-of-a-frame.
///
/// A prior is one more residual without kernel, which no round leaves out. Any number of
/// observations is enough with it; with fewer than 3 the prior alone is the result.
PoseEstimate optimize_pose(const Pose& T_cw_initial, const Camera& camera,
                           const std::vector<PoseObservation>& observations,
                           const PosePrior* prior = nullptr);

/// The same for a frame's associations, at their aligned positions where there are some
/// (TrackedFrame::aligned). An aligned one is an outlier only if its keypoint is one as well.
/// Starts from the frame's pose, and writes the frame's pose and outlier flags (of all slots; those
/// without a point get 0). `outlier` of the result stays empty, so that calls after a thread's
/// first do not allocate. Throws StateError when the frame has no pose.
PoseEstimate optimize_pose(TrackedFrame& frame, const PosePrior* prior = nullptr);

/// Covariance (rotation, translation; left perturbation) of a frame's pose, from the assumed noise
/// of its keypoints. Use it for a frame whose keypoints became the points: its residuals are zero,
/// so they do not show the noise. Outliers take no part; zero where fewer than 3 associations are
/// left. Throws StateError without a pose.
Matrix6d pose_covariance(const TrackedFrame& frame);

}  // namespace orbslam
