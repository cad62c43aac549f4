// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "base/similarity.hpp"
#include "camera/camera.hpp"

namespace orbslam {

/// A keypoint of keyframe 1 matched to one of keyframe 2. Each keyframe has its own point of the
/// map there; the similarity should carry one onto the other.
struct SimilarityMatch {
  Eigen::Vector3d point_1 = Eigen::Vector3d::Zero();  ///< camera 1, its own point
  Eigen::Vector3d point_2 = Eigen::Vector3d::Zero();  ///< camera 2, the same
  Eigen::Vector2d pixel_1 = Eigen::Vector2d::Zero();  ///< the keypoints, undistorted
  Eigen::Vector2d pixel_2 = Eigen::Vector2d::Zero();
  double inverse_sigma2_1 = 1;  ///< of the keypoints' levels [1 / pixels^2]
  double inverse_sigma2_2 = 1;
  bool mutual = true;  ///< false: of keyframe 1 only the keypoint is known, of keyframe 2 the point
};

struct SimilarityOptions {
  double max_chi2 = 10;    ///< gate of either squared whitened residual and of the Huber kernels
  bool fix_scale = false;  ///< keep the scale of the start
};

struct SimilarityEstimate {
  Similarity S_12;
  int n_inliers = 0;                  ///< 0 when too few matches were left
  std::vector<std::uint8_t> outlier;  ///< per match
  int iterations = 0;
};

/// Refines S_12 on matches: pixels of keyframe 1 minus projections of S_12 point_2, and pixels of
/// keyframe 2 minus projections of S_12^-1 point_1, with a Huber kernel. 5 iterations of damped
/// Gauss-Newton; matches with a residual beyond max_chi2 or a point that is not in front of the
/// other camera become outliers; 10 more iterations without them (5 when there are none), and those
/// left are judged once more. With fewer than 10 matches left after the first judgement S_12 stays
/// at its start and n_inliers is 0. Matches with NaN or infinite numbers are outliers and take no
/// part. Throws std::invalid_argument unless max_chi2 > 0. See
/// docs/method/adjustment.md#similarity-of-two-keyframes.
SimilarityEstimate optimize_similarity(const Similarity& S_12_initial, const Camera& camera_1,
                                       const Camera& camera_2,
                                       const std::vector<SimilarityMatch>& matches,
                                       const SimilarityOptions& options = {});

}  // namespace orbslam
