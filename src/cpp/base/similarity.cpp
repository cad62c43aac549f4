// SPDX-License-Identifier: BSD-3-Clause
#include "base/similarity.hpp"

#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace orbslam {
namespace {

double valid_scale(double scale) {
  if (!(scale > 0) || !std::isfinite(scale)) {
    throw std::invalid_argument("a similarity's scale must be positive, not " +
                                std::to_string(scale));
  }
  return scale;
}

/// W(omega, sigma) = integral over u in [0, 1] of exp(sigma u) R(u omega), for sigma >= 0: the
/// matrix of t = W upsilon, where (omega, upsilon, sigma) is the logarithm and t the translation.
///
/// Its coefficients follow from phi(z) = (exp(z) - 1) / z at z = sigma + i a, a = |omega|:
/// C = phi(sigma), A = Im phi(z) / a, B = (C - Re phi(z)) / a^2. The closed forms cancel where a,
/// sigma or both are small. The power series of phi, with the divisions by a carried out on its
/// terms, has no such places, and with sigma >= 0 and a <= pi little cancels in its sum.
Eigen::Matrix3d translation_matrix(const Eigen::Vector3d& omega, double sigma) {
  const double squared_angle = omega.squaredNorm();
  // Terms of order k over (k + 1)!: sigma^k, Re z^k, Im z^k / a and (sigma^k - Re z^k) / a^2.
  double power = 1, real = 1, imaginary = 0, rest = 0;
  double A = 0, B = 0, C = 1;
  const double size = std::sqrt(squared_angle + sigma * sigma);
  double bound = 1;  // of the terms of C, and of those of A and B up to a factor k^2
  for (int k = 1; k < 1000; ++k) {
    const double next_rest = sigma * rest + imaginary;
    const double next_imaginary = sigma * imaginary + real;
    const double next_real = sigma * real - squared_angle * imaginary;
    const double inverse = 1.0 / (k + 1);
    rest = next_rest * inverse;
    imaginary = next_imaginary * inverse;
    real = next_real * inverse;
    power *= sigma * inverse;
    A += imaginary;
    B += rest;
    C += power;
    bound *= size * inverse;
    if (k > 2 && k * k * bound <= std::numeric_limits<double>::epsilon() * size * size * 1e-2)
      break;
  }
  const Eigen::Matrix3d cross = skew(omega);
  return A * cross + B * cross * cross + C * Eigen::Matrix3d::Identity();
}

}  // namespace

Similarity::Similarity(double scale, const Eigen::Quaterniond& rotation,
                       const Eigen::Vector3d& translation)
    : scale_(valid_scale(scale)), rotation_(rotation.normalized()), translation_(translation) {}

Similarity::Similarity(double scale, const Eigen::Matrix3d& rotation,
                       const Eigen::Vector3d& translation)
    : Similarity(scale, Eigen::Quaterniond(rotation), translation) {}

Similarity Similarity::exp(const Vector7d& delta) {
  const Eigen::Vector3d omega = delta.head<3>(), upsilon = delta.segment<3>(3);
  const double sigma = delta(6), scale = std::exp(sigma);
  Vector6d turn;
  turn << omega, Eigen::Vector3d::Zero();
  const Eigen::Quaterniond q = Pose::exp(turn).rotation();
  if (sigma >= 0) return Similarity(scale, q, translation_matrix(omega, sigma) * upsilon);
  // The integral read from its end: W(omega, sigma) = exp(sigma) R(omega) W(-omega, -sigma).
  return Similarity(scale, q, scale * (q * (translation_matrix(-omega, -sigma) * upsilon)));
}

Vector7d Similarity::log() const {
  const Eigen::Vector3d omega = Pose(rotation_, Eigen::Vector3d::Zero()).log().head<3>();
  const double sigma = std::log(scale_);
  const Eigen::Vector3d upsilon =
      sigma >= 0 ? Eigen::Vector3d(translation_matrix(omega, sigma).inverse() * translation_)
                 : Eigen::Vector3d(translation_matrix(-omega, -sigma).inverse() *
                                   (rotation_.conjugate() * translation_) / scale_);
  Vector7d delta;
  delta << omega, upsilon, sigma;
  return delta;
}

Eigen::Matrix4d Similarity::matrix() const {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = scale_ * rotation_matrix();
  m.topRightCorner<3, 1>() = translation_;
  return m;
}

Similarity Similarity::inverse() const {
  const Eigen::Quaterniond inverse_rotation = rotation_.conjugate();
  return Similarity(1 / scale_, inverse_rotation, inverse_rotation * -translation_ / scale_);
}

Similarity Similarity::operator*(const Similarity& other) const {
  return Similarity(scale_ * other.scale_, rotation_ * other.rotation_, *this * other.translation_);
}

Matrix7d Similarity::adjoint() const {
  const Eigen::Matrix3d R = rotation_matrix();
  Matrix7d result = Matrix7d::Zero();
  result.topLeftCorner<3, 3>() = R;
  result.block<3, 3>(3, 0) = skew(translation_) * R;
  result.block<3, 3>(3, 3) = scale_ * R;
  result.block<3, 1>(3, 6) = -translation_;
  result(6, 6) = 1;
  return result;
}

Matrix7d similarity_ad(const Vector7d& delta) {
  const Eigen::Matrix3d turn = skew(delta.head<3>());
  Matrix7d ad = Matrix7d::Zero();
  ad.topLeftCorner<3, 3>() = turn;
  ad.block<3, 3>(3, 0) = skew(delta.segment<3>(3));
  ad.block<3, 3>(3, 3) = turn + delta(6) * Eigen::Matrix3d::Identity();
  ad.block<3, 1>(3, 6) = -delta.segment<3>(3);
  return ad;
}

Matrix7d similarity_left_jacobian_inverse(const Vector7d& delta) {
  const Matrix7d ad = similarity_ad(delta);
  const Matrix7d ad2 = ad * ad;
  const Matrix7d identity = Matrix7d::Identity();
  const double size = ad.norm();
  if (size < 0.1) {
    // x / (exp(x) - 1) by Bernoulli numbers; the first term left out is ad^8 / 1209600.
    const Matrix7d ad4 = ad2 * ad2;
    return identity - ad / 2 + ad2 / 12 - ad4 / 720 + ad4 * ad2 / 30240;
  }
  Matrix7d sum = identity + ad / 2, term = ad / 2;
  for (int k = 2; k < 1000; ++k) {
    term = (term * ad / (k + 1)).eval();
    sum += term;
    if (k > size && term.norm() < 1e-17 * sum.norm()) break;
  }
  return sum.inverse();
}

}  // namespace orbslam
