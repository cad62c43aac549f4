// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace orbslam {

/// A point of a bundle as a direction and an inverse depth seen from a fixed place (Civera et al.
/// 2008; Montiel et al. 2006): its pixels are nearly linear in these parameters, even with an
/// uncertain depth, so steps may be long. The three parameters are 0 at the start. See
/// docs/method/adjustment.md#full-bundle-adjustment.
class BundlePoint {
 public:
  static constexpr int kParameters = 3;

  /// `place`: one of the point's observers, say; world. It does not move with that camera.
  BundlePoint(const Eigen::Vector3d& place, const Eigen::Vector3d& start);
  /// Moves to the given parameters: two slopes and the relative change of the inverse depth. The
  /// point stays in front of the place for any parameters.
  void move(const double* parameters);

  const Eigen::Vector3d& position() const { return position_; }  ///< world
  const Eigen::Matrix3d& jacobian() const { return jacobian_; }  ///< of position by parameters

 private:
  Eigen::Vector3d place_;
  Eigen::Matrix3d axes_;  // two across, and the ray to the start as long as it is
  Eigen::Vector3d position_;
  Eigen::Matrix3d jacobian_;
};

}  // namespace orbslam
