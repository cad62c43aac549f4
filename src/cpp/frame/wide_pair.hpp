// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "base/pose.hpp"
#include "camera/camera.hpp"
#include "features/orb_extractor.hpp"
#include "frame/stereo_matching.hpp"

namespace orbslam {

/// A pair of cameras with any lenses, matched without rectification. Every direction is described
/// by its epipolar plane (an angle around the baseline) and its angle from the baseline. Both
/// cameras see a point in one plane, the right one at an angle that is larger by the parallax.
class WidePair {
 public:
  /// `left` must have a wide pair, whose centre is that of `T_right_left` (left to right camera
  /// coordinates, metres); SettingsError otherwise.
  WidePair(std::shared_ptr<const Camera> left, CameraModel right, const Pose& T_right_left);

  const Camera& left() const { return *left_; }

  /// Depths along the rays of the left keypoints, and their columns in the virtual right image, for
  /// keypoints that both cameras see. Throws ImageError as match_stereo() does. See
  /// docs/method/frame.md#fisheye-pairs.
  StereoMatches match(const Extraction& left, const Extraction& right,
                      const ScalePyramid& scales) const;

  /// Distance from the left camera [m] of a point that is seen along `left_ray` and `right_ray`,
  /// each in its camera's frame; by their angles from the baseline. Not above 0: the rays do not
  /// meet in front of the cameras.
  double distance(const Eigen::Vector3d& left_ray, const Eigen::Vector3d& right_ray) const;

 private:
  /// A direction in bipolar angles, and pixels per radian of its camera there.
  struct Direction {
    double plane, angle;  ///< around the baseline, and from it [rad]
    double sine;          ///< of the angle
    double across;        ///< pixels per radian across the plane
    double along;         ///< pixels per radian in the plane
  };
  struct Candidate;
  class Search;

  Direction direction(const Eigen::Vector3d& ray_in_left, const Eigen::Matrix<double, 2, 3>& J,
                      const Eigen::Matrix3d& R_camera_left) const;

  std::shared_ptr<const Camera> left_;
  CameraModel right_;
  Pose T_rl_;
  Eigen::Matrix3d R_rl_;
  Eigen::Matrix3d axes_;  ///< rows: baseline, and two axes across it, in the left camera's frame
  double baseline_;
};

}  // namespace orbslam
