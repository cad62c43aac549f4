// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "base/pose.hpp"

namespace orbslam {

using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;

/// A similarity: rotation, translation and a positive scale. A variable named `S_ab` maps
/// coordinates of frame b into frame a: `p_a = s R p_b + t`, hence `S_ac = S_ab * S_bc`.
///
/// Tangent vectors are ordered (omega, upsilon, sigma): rotation [rad], translation, logarithm of
/// the scale. They act on the left: `exp(delta) * S`.
class Similarity {
 public:
  Similarity() : rotation_(Eigen::Quaterniond::Identity()), translation_(Eigen::Vector3d::Zero()) {}
  /// The quaternion is normalised. Throws std::invalid_argument unless the scale is positive and
  /// finite.
  Similarity(double scale, const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation);
  Similarity(double scale, const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation);
  /// The rigid transform as a similarity of scale 1.
  explicit Similarity(const Pose& T_ab)
      : rotation_(T_ab.rotation()), translation_(T_ab.translation()) {}

  /// Exponential map; accurate for small rotations and scales near 1, together or alone.
  static Similarity exp(const Vector7d& delta);
  /// Inverse of exp, rotation angle in [0, pi].
  Vector7d log() const;

  double scale() const { return scale_; }
  const Eigen::Quaterniond& rotation() const { return rotation_; }
  const Eigen::Vector3d& translation() const { return translation_; }
  Eigen::Matrix3d rotation_matrix() const { return rotation_.toRotationMatrix(); }
  /// [s R, t; 0, 1].
  Eigen::Matrix4d matrix() const;

  /// (1/s, R^T, -R^T t / s).
  Similarity inverse() const;
  Similarity operator*(const Similarity& other) const;
  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const {
    return scale_ * (rotation_ * point) + translation_;
  }

  /// For `S_cw`: the pose (R, t / s) of a camera that sees every point in the same pixel.
  Pose pose() const { return Pose(rotation_, translation_ / scale_); }

  /// `S exp(delta) S^-1 = exp(Ad(S) delta)`.
  Matrix7d adjoint() const;

 private:
  double scale_ = 1;
  Eigen::Quaterniond rotation_;
  Eigen::Vector3d translation_;
};

/// ad(delta): the derivative of Ad(exp(delta)) at 0, hence `Ad(exp(delta)) = exp(ad(delta))`.
Matrix7d similarity_ad(const Vector7d& delta);

/// The inverse of the left Jacobian: to first order in a small vector d,
/// `log(exp(d) exp(delta)) = delta + J d`. On the right it is the one of -delta. For rotation
/// angles below 2 pi.
Matrix7d similarity_left_jacobian_inverse(const Vector7d& delta);

}  // namespace orbslam
