// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/rotation_jacobian.hpp"

#include <cmath>

#include "base/pose.hpp"

namespace orbslam {

Eigen::Matrix3d rotation_left_jacobian(const Eigen::Vector3d& w) {
  const double angle_squared = w.squaredNorm();
  const double angle = std::sqrt(angle_squared);
  // Series below 1e-4 rad, where the closed forms lose digits.
  const bool small = angle < 1e-4;
  const double b = small ? 0.5 - angle_squared / 24 : (1 - std::cos(angle)) / angle_squared;
  const double c =
      small ? 1.0 / 6 - angle_squared / 120 : (angle - std::sin(angle)) / (angle_squared * angle);
  const Eigen::Matrix3d W = skew(w);
  return Eigen::Matrix3d::Identity() + b * W + c * W * W;
}

}  // namespace orbslam
