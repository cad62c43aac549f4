// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>

#include "camera/bend.hpp"

namespace orbslam {

/// OpenCV's distortion of the plane at unit depth, with its domain: k1, k2, p1, p2, k3, k4, k5, k6
/// and the thin prism s1, s2, s3, s4 (J. Weng, P. Cohen, M. Herniou, "Camera
/// calibration with distortion models and accuracy evaluation", 1992). The domain is the region
/// around the axis in which the distortion is one-to-one.
class PlaneDistortion {
 public:
  explicit PlaneDistortion(const std::array<double, 12>& coefficients);

  /// Where the lens shows the point. False beyond the radius at which the model folds over.
  bool distort(const Eigen::Vector2d& straight, Bent& bent) const {
    const double r2 = straight.squaredNorm();
    if (!(r2 < largest_r2_)) return false;
    bent = bend(radial_tangential_, straight);
    const auto [s1, s2, s3, s4] = prism_;
    bent.at.x() += (s2 * r2 + s1) * r2;
    bent.at.y() += (s4 * r2 + s3) * r2;
    bent.J.row(0) += (2 * (2 * s2 * r2 + s1)) * straight.transpose();
    bent.J.row(1) += (2 * (2 * s4 * r2 + s3)) * straight.transpose();
    const double determinant = bent.J(0, 0) * bent.J(1, 1) - bent.J(0, 1) * bent.J(1, 0);
    return determinant > 0 && bent.J(0, 0) + bent.J(1, 1) > 0;
  }

  /// The point that the lens shows at `bent`, by Newton's method. False where nothing fits.
  bool undistort(const Eigen::Vector2d& bent, Eigen::Vector2d& straight) const;

 private:
  /// Newton's method from `straight`.
  bool approach(const Eigen::Vector2d& bent, Eigen::Vector2d& straight) const;

  Distortion radial_tangential_;
  std::array<double, 4> prism_;
  bool has_tangential_;  ///< with the prism: the radius alone does not describe the distortion
  /// Squared radius at which the radial part stops increasing, or at which a direction would enter
  /// the domain again after its end.
  double largest_r2_;
};

}  // namespace orbslam
