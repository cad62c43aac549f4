// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "base/pose.hpp"
#include "camera/camera.hpp"
#include "geometry/ransac.hpp"

namespace orbslam {

/// Points of the map and the pixels that may show them, one correspondence per column.
struct PnpProblem {
  Eigen::Matrix3Xd points;  ///< world
  Eigen::Matrix2Xd pixels;  ///< undistorted
  Eigen::VectorXd sigma2;   ///< variance of each pixel [pixels^2]
  std::shared_ptr<const Camera> camera;
};

inline constexpr std::size_t kPnpMinInliers = 10;  ///< fewest inliers that make a pose

struct PnpOptions {
  RansacOptions ransac{0.99, kPnpMinInliers, 0.5, 300, 3};
  double max_chi2 = 5.991;  ///< squared error over sigma2 that an inlier stays below
};

struct PnpPose {
  Pose T_cw;
  std::vector<std::uint8_t> inliers;  ///< per correspondence
  std::size_t n_inliers = 0;
  bool refined = false;  ///< estimated from all inliers of a sample's pose, not from the sample
};

/// RANSAC over EPnP, in slices: the tracker lets several candidate keyframes take turns. How the
/// iterations are sliced does not change what is found. A sample of a rig is of one of its cameras,
/// and is judged by the correspondences of all. See
/// docs/method/relocalization.md#pose-from-points.
class PnpRansac {
 public:
  /// Throws std::invalid_argument when the arrays differ in length, there is no camera, or an
  /// option is out of range.
  PnpRansac(PnpProblem problem, const PnpOptions& options, std::uint64_t seed);

  /// Runs at most n further iterations. Returns the pose refined on the inliers of a new best
  /// sample as soon as it has more than min_inliers() inliers; when the last iteration is done,
  /// the best sample's pose if there is one; otherwise nothing.
  std::optional<PnpPose> iterate(int n);

  /// No iterations are left. So from the start with fewer correspondences than min_inliers().
  bool exhausted() const { return iterations_ >= max_iterations_; }
  int iterations() const { return iterations_; }
  int max_iterations() const { return max_iterations_; }
  std::size_t min_inliers() const { return min_inliers_; }

 private:
  PnpPose judge(const Pose& T_cw) const;
  std::optional<PnpPose> pose_of_sample();
  /// The pose by EPnP on some correspondences, of one camera where there are several.
  std::optional<PnpPose> pose_of(const std::vector<std::size_t>& chosen) const;
  /// Of a rig: four correspondences of one camera, which is drawn by their numbers.
  std::vector<std::size_t> draw_of_rig();
  std::optional<PnpPose> refine_best() const;

  PnpProblem problem_;
  double max_chi2_ = 0;
  std::size_t min_inliers_ = 0;
  int max_iterations_ = 0;
  int iterations_ = 0;
  MinimalSampler sampler_;
  /// Of a rig: correspondences by camera, and samplers of those of a camera.
  std::vector<std::vector<std::size_t>> by_camera_;
  std::vector<MinimalSampler> samplers_;
  PnpPose best_;
};

}  // namespace orbslam
