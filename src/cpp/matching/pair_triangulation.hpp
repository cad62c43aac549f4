// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "base/pose.hpp"
#include "frame/frame.hpp"

namespace orbslam {

/// Decides whether a pair of matched features of two frames makes a map point, and where it lies
/// (spec 13, 5.3): from the two rays when their parallax is wide enough, else from the depth of
/// the feature that measures it better; then depth, reprojection and scale must agree.
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
    double depth_parallax(std::size_t i, double none) const;
    bool sees(const Eigen::Vector3d& point, std::size_t i) const;
  };

  std::optional<Eigen::Vector3d> locate(std::size_t i_1, std::size_t i_2) const;
  bool scales_agree(const Eigen::Vector3d& point, std::size_t i_1, std::size_t i_2) const;

  View view_1_, view_2_;
};

}  // namespace orbslam
