// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "base/pose.hpp"
#include "base/worker_thread.hpp"
#include "camera/camera.hpp"
#include "geometry/motion_choice.hpp"
#include "geometry/point_pairs.hpp"

namespace orbslam {

enum class TwoViewModel { none, homography, fundamental };

struct TwoViewOptions {
  double sigma = 1.0;  ///< standard deviation of a keypoint's position [pixels]
  int n_samples = 200;
  std::size_t min_matches = 100;
  MotionLimits limits;
};

/// Two views and what is known about them. All must outlive the call.
struct TwoViewInput {
  const std::vector<Eigen::Vector2f>& initial;  ///< all keypoints of view 1, pixels of the plane
  const std::vector<Eigen::Vector2f>& current;  ///< all keypoints of view 2
  const std::vector<int>& matches;              ///< per initial keypoint: index in current, or -1
  const Camera& camera;                         ///< of both views
};

/// A motion that explains the matches, and the points that it triangulates.
struct TwoViewMotion {
  Pose T_21;            ///< camera 1 to camera 2 with |translation| = 1
  double parallax = 0;  ///< degrees
  // Per initial keypoint.
  std::vector<Eigen::Vector3d> points;     ///< frame of camera 1
  std::vector<std::uint8_t> triangulated;  ///< the point is well placed: use it
};

/// The motion and the points, or the reason for failure; and the intermediate results in both
/// cases.
struct TwoViewResult {
  TwoViewOutcome outcome = TwoViewOutcome::too_few_matches;
  TwoViewModel model = TwoViewModel::none;  ///< the one that was chosen
  std::size_t n_matches = 0;
  double homography_score = 0, fundamental_score = 0;
  /// Of the homography in the sum of both; above 0.40 it is chosen.
  double homography_ratio = 0;
  Eigen::Matrix3d H_21 = Eigen::Matrix3d::Zero(), F_21 = Eigen::Matrix3d::Zero();
  std::size_t n_homography_inliers = 0, n_fundamental_inliers = 0;
  std::vector<MotionScore> hypotheses;  ///< in the order of motions_from_...()
  std::size_t best_hypothesis = 0;

  /// Camera 1 to camera 2 with |translation| = 1; identity unless reconstructed.
  Pose T_21;
  double parallax = 0;  ///< of the best hypothesis, degrees
  // Per initial keypoint; all zero unless reconstructed.
  std::vector<Eigen::Vector3d> points;     ///< frame of camera 1
  std::vector<std::uint8_t> triangulated;  ///< the point is well placed: use it
  // Per initial keypoint, as soon as the models were estimated.
  std::vector<std::uint8_t> homography_inlier, fundamental_inlier;

  /// If the motion is ambiguous: all motions that triangulate at least half as many points as the
  /// best one, also with little parallax, in the order of `hypotheses`. Further views can decide
  /// between them: two views of a plane allow two motions, and only one of these agrees with all
  /// other views.
  std::vector<TwoViewMotion> alternatives;

  bool success() const { return outcome == TwoViewOutcome::reconstructed; }
};

/// Minimal samples of eight distinct matches each out of n_matches >= 8.
std::vector<EightPairs> draw_samples(std::size_t n_matches, int n_samples, std::uint64_t seed);

/// Initial structure of a monocular map (Mur-Artal et al. 2015, section IV): a homography and a
/// fundamental matrix are estimated side by side from the same samples; the score ratio decides
/// which one gives the motion hypotheses, and the best of these must win clearly. Where a
/// homography leaves two motions and the fundamental matrix explains a tenth more matches, that is
/// tried as well. With a helper thread both models and the hypotheses are
/// worked on in two threads; the result is the same. Throws std::invalid_argument for matches
/// that do not fit the points and for options out of range. See docs/method/start.md#two-views.
TwoViewResult reconstruct_two_views(const TwoViewInput& input, const TwoViewOptions& options,
                                    std::uint64_t seed, WorkerThread* helper);

/// The same with given samples; their indices count the matches, ascending by initial keypoint.
TwoViewResult reconstruct_two_views(const TwoViewInput& input, const TwoViewOptions& options,
                                    const std::vector<EightPairs>& samples, WorkerThread* helper);

/// Triangulates all matches that agree with a known motion, by the rules of reconstruct_two_views.
/// The length of T_21's translation becomes 1; throws std::invalid_argument when it is 0, and for
/// matches that do not fit the points.
TwoViewMotion place_points(const TwoViewInput& input, const Pose& T_21, double sigma);

}  // namespace orbslam
