// SPDX-License-Identifier: BSD-3-Clause
#include "inertial/so3.hpp"

#include <cmath>

namespace orbslam {

Eigen::Quaterniond so3_exp(const Eigen::Vector3d& omega) {
  Vector6d xi = Vector6d::Zero();
  xi.head<3>() = omega;
  return Pose::exp(xi).rotation();
}

Eigen::Vector3d so3_log(const Eigen::Quaterniond& rotation) {
  return Pose(rotation, Eigen::Vector3d::Zero()).log().head<3>();
}

Eigen::Matrix3d so3_right_jacobian(const Eigen::Vector3d& omega) {
  const double squared = omega.squaredNorm();
  const double angle = std::sqrt(squared);
  // Taylor series below 1e-4 rad, where the closed forms lose digits.
  double b, c;
  if (angle < 1e-4) {
    b = 0.5 - squared / 24.0;
    c = 1.0 / 6.0 - squared / 120.0;
  } else {
    b = (1.0 - std::cos(angle)) / squared;
    c = (angle - std::sin(angle)) / (squared * angle);
  }
  const Eigen::Matrix3d cross = skew(omega);
  return Eigen::Matrix3d::Identity() - b * cross + c * cross * cross;
}

Matrix6d adjoint(const Pose& T) {
  const Eigen::Matrix3d R = T.rotation_matrix();
  Matrix6d Ad = Matrix6d::Zero();
  Ad.topLeftCorner<3, 3>() = Ad.bottomRightCorner<3, 3>() = R;
  Ad.bottomLeftCorner<3, 3>() = skew(T.translation()) * R;
  return Ad;
}

}  // namespace orbslam
