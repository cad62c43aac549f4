// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "base/similarity.hpp"
#include "camera/camera.hpp"
#include "geometry/ransac.hpp"

namespace orbslam {

/// Points of the map that two keyframes see, matched, one correspondence per column.
struct Sim3Problem {
  Eigen::Matrix3Xd points_1;  ///< camera 1, its own point
  Eigen::Matrix3Xd points_2;  ///< camera 2, its own point
  Eigen::VectorXd sigma2_1;   ///< variance of the keypoint in keyframe 1 [pixels^2]
  Eigen::VectorXd sigma2_2;   ///< the same in keyframe 2
  std::shared_ptr<const Camera> camera_1, camera_2;
};

struct Sim3Options {
  /// An inlier ratio of 0: the iterations suffice for min_inliers among the correspondences.
  RansacOptions ransac{0.99, 20, 0, 300, 3};
  double max_chi2 = 9.210;  ///< squared error over sigma2 that an inlier stays below in both images
  bool fix_scale = false;   ///< where depth is measured the scale cannot drift
};

struct Sim3Estimate {
  Similarity S_12;
  std::vector<std::uint8_t> inliers;  ///< per correspondence
  std::size_t n_inliers = 0;
};

/// RANSAC over the closed form of three correspondences, in slices: where the refinement refuses a
/// similarity, verify_loop_candidate() goes on behind it. How the iterations are sliced does not
/// change what is found. See docs/method/loops.md#verification.
class Sim3Ransac {
 public:
  /// Throws std::invalid_argument when the arrays differ in length, a camera is missing, or an
  /// option is out of range.
  Sim3Ransac(const Sim3Problem& problem, const Sim3Options& options, std::uint64_t seed);

  /// Runs at most n further iterations. Returns the first similarity with more than min_inliers
  /// inliers; a further call goes on behind it. A collinear sample counts as an iteration.
  std::optional<Sim3Estimate> iterate(int n);

  /// No iterations are left. So from the start with fewer correspondences than min_inliers.
  bool exhausted() const { return iterations_ >= max_iterations_; }
  int iterations() const { return iterations_; }
  int max_iterations() const { return max_iterations_; }

  /// The similarity with its inliers: correspondences whose points, carried into the other camera,
  /// lie in front of it and project near the other point's projection, both ways. Pixels of
  /// keypoints play no part.
  Sim3Estimate judge(const Similarity& S_12) const;

 private:
  Sim3Problem problem_;
  Eigen::Matrix2Xd pixels_1_, pixels_2_;  // projections of the cameras' own points
  Eigen::VectorXd gates_1_, gates_2_;     // squared pixels; negative for points behind their camera
  std::size_t min_inliers_ = 0;
  bool fix_scale_ = false;
  int max_iterations_ = 0;
  int iterations_ = 0;
  MinimalSampler sampler_;
};

}  // namespace orbslam
