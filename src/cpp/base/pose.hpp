// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace orbslam {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// The matrix [v]x with [v]x w = v x w.
Eigen::Matrix3d skew(const Eigen::Vector3d& v);

/// A rigid transform. A variable named `T_ab` maps coordinates of frame b into frame a:
/// `p_a = T_ab * p_b`, hence `T_ac = T_ab * T_bc`.
///
/// Tangent vectors are ordered (rotation, translation) and act on the left:
/// `exp(xi) * T`, with xi = (omega, upsilon).
class Pose {
 public:
  Pose() : rotation_(Eigen::Quaterniond::Identity()), translation_(Eigen::Vector3d::Zero()) {}
  /// The quaternion is normalised.
  Pose(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation);
  Pose(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation);

  /// From a 4x4 homogeneous matrix; the rotation is projected onto SO(3).
  static Pose from_matrix(const Eigen::Matrix4d& matrix);
  /// Takes a quaternion of unit length without normalising it, so that a stored pose is restored
  /// bit by bit. The caller has checked its length.
  static Pose from_unit(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation) {
    Pose pose;
    pose.rotation_ = rotation;
    pose.translation_ = translation;
    return pose;
  }
  /// Exponential map; stable for small rotations.
  static Pose exp(const Vector6d& xi);

  /// Inverse of exp, rotation angle in [0, pi].
  Vector6d log() const;

  const Eigen::Quaterniond& rotation() const { return rotation_; }
  const Eigen::Vector3d& translation() const { return translation_; }
  Eigen::Matrix3d rotation_matrix() const { return rotation_.toRotationMatrix(); }
  Eigen::Matrix4d matrix() const;

  Pose inverse() const;
  /// For `T_cw`: the camera centre in the world, -R^T t.
  Eigen::Vector3d center() const { return rotation_.conjugate() * -translation_; }

  Pose operator*(const Pose& other) const;
  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const {
    return rotation_ * point + translation_;
  }

 private:
  Eigen::Quaterniond rotation_;
  Eigen::Vector3d translation_;
};

}  // namespace orbslam
