// SPDX-License-Identifier: BSD-3-Clause
#include "base/pose.hpp"

#include <Eigen/SVD>
#include <cmath>

namespace orbslam {

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Pose::Pose(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation)
    : rotation_(rotation.normalized()), translation_(translation) {}

Pose::Pose(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation)
    : rotation_(Eigen::Quaterniond(rotation).normalized()), translation_(translation) {}

Pose Pose::from_matrix(const Eigen::Matrix4d& matrix) {
  const Eigen::Matrix3d block = matrix.topLeftCorner<3, 3>();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(block, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d sign = Eigen::Matrix3d::Identity();
  sign(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  return Pose(Eigen::Matrix3d(svd.matrixU() * sign * svd.matrixV().transpose()),
              matrix.topRightCorner<3, 1>());
}

Pose Pose::exp(const Vector6d& xi) {
  const Eigen::Vector3d omega = xi.head<3>();
  const Eigen::Vector3d upsilon = xi.tail<3>();
  const double angle_squared = omega.squaredNorm();
  const double angle = std::sqrt(angle_squared);

  // With a the angle and W = [omega]x: the quaternion is (cos(a/2), sin(a/2) / a omega), the
  // translation V upsilon with V = I + b W + c W^2, b = (1 - cos a) / a^2, c = (a - sin a) / a^3.
  // Taylor series below 1e-4 rad, where the closed forms lose digits.
  double sin_half_over_angle, b, c;
  if (angle < 1e-4) {
    sin_half_over_angle = 0.5 - angle_squared / 48.0;
    b = 0.5 - angle_squared / 24.0;
    c = 1.0 / 6.0 - angle_squared / 120.0;
  } else {
    sin_half_over_angle = std::sin(0.5 * angle) / angle;
    b = (1.0 - std::cos(angle)) / angle_squared;
    c = (angle - std::sin(angle)) / (angle_squared * angle);
  }
  const Eigen::Vector3d imaginary = sin_half_over_angle * omega;
  const Eigen::Quaterniond q(std::cos(0.5 * angle), imaginary.x(), imaginary.y(), imaginary.z());
  const Eigen::Vector3d cross = omega.cross(upsilon);
  return Pose(q, upsilon + b * cross + c * omega.cross(cross));
}

Vector6d Pose::log() const {
  // q and -q are the same rotation; the one with w >= 0 has the angle in [0, pi].
  const double sign = rotation_.w() < 0 ? -1.0 : 1.0;
  const Eigen::Vector3d imaginary = sign * rotation_.vec();
  const double w = sign * rotation_.w();
  const double sin_half = imaginary.norm();
  const double angle = 2.0 * std::atan2(sin_half, w);
  const Eigen::Vector3d omega =
      sin_half < 1e-8 ? Eigen::Vector3d(2.0 * imaginary) : (angle / sin_half) * imaginary;

  // V^-1 = I - [omega]/2 + d [omega]^2
  const double d =
      angle < 1e-3
          ? 1.0 / 12.0 + angle * angle / 720.0
          : (1.0 - 0.5 * angle * std::cos(0.5 * angle) / std::sin(0.5 * angle)) / (angle * angle);
  const Eigen::Vector3d cross = omega.cross(translation_);
  Vector6d xi;
  xi << omega, translation_ - 0.5 * cross + d * omega.cross(cross);
  return xi;
}

Eigen::Matrix4d Pose::matrix() const {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = rotation_matrix();
  m.topRightCorner<3, 1>() = translation_;
  return m;
}

Pose Pose::inverse() const {
  const Eigen::Quaterniond inverse_rotation = rotation_.conjugate();
  return Pose(inverse_rotation, inverse_rotation * -translation_);
}

Pose Pose::operator*(const Pose& other) const {
  return Pose(rotation_ * other.rotation_, rotation_ * other.translation_ + translation_);
}

}  // namespace orbslam
