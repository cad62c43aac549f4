// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "base/pose.hpp"
#include "frame/frame.hpp"

namespace orbslam {

/// Decides whether a pair of matched features of two frames makes a map point, and where it lies.
/// The point is triangulated from the two rays if their parallax is wider than that of the measured
/// depths over the baseline; without a measured depth it must be wider than 1.15 degrees. Otherwise
/// the point is at the measured depth with the wider parallax; without a measured depth there is no
/// point. The point must be in front of both cameras and pass a chi-square gate in both. Its
/// distances must agree with the levels of both features to 1.5 times the pyramid's factor. See
/// docs/method/mapping.md#new-points.
class PairTriangulation {
 public:
  /// The frames must outlive this object.
  PairTriangulation(const Frame& frame_1, const Pose& T_1w, const Frame& frame_2, const Pose& T_2w);

  /// The point in the world, or nothing when the pair is rejected.
  std::optional<Eigen::Vector3d> operator()(std::size_t i_1, std::size_t i_2) const;

 private:
  struct View {
    const Frame* frame;
    Pose T_cw, T_wc;

    Eigen::Vector3d ray(std::size_t i) const;
    /// World to the axes of the body, with the camera of keypoint i as origin.
    Pose from_world(std::size_t i) const;
    Eigen::Vector3d centre(std::size_t i) const;  ///< of that camera, in the world
    double depth_parallax(std::size_t i, double none) const;
    bool sees(const Eigen::Vector3d& point, std::size_t i) const;
  };

  std::optional<Eigen::Vector3d> locate(std::size_t i_1, std::size_t i_2) const;
  bool scales_agree(const Eigen::Vector3d& point, std::size_t i_1, std::size_t i_2) const;

  View view_1_, view_2_;
};

}  // namespace orbslam
