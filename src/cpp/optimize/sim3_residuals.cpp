// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/sim3_residuals.hpp"

#include <cmath>

namespace orbslam::sim3_residuals {
namespace {

constexpr double kTinyDepth = 1e-9;

/// d(exp(delta) p) / d(delta) at 0.
Eigen::Matrix<double, 3, 7> moved_by_tangent(const Eigen::Vector3d& p) {
  Eigen::Matrix<double, 3, 7> derivative;
  derivative << -skew(p), Eigen::Matrix3d::Identity(), p;
  return derivative;
}

std::optional<Residual> residual(const Eigen::Vector3d& p_c,
                                 const Eigen::Matrix<double, 3, 7>& derivative,
                                 const Camera& camera, const Eigen::Vector2d& pixel,
                                 double inverse_sigma2) {
  const Sight B = camera.sight(pixel.x(), pixel.y());
  const Eigen::Vector3d q = apply(B, p_c);
  // Also valid behind the camera: a point may pass through the camera's plane during an adjustment.
  if (!(std::abs(q.z()) > kTinyDepth)) return std::nullopt;
  const double weight = std::sqrt(inverse_sigma2), inverse_q = 1 / q.z();
  const Eigen::Vector2d predicted = q.head<2>() * inverse_q;
  Residual result;
  result.error = -weight * predicted;
  result.jacobian =
      -weight * inverse_q * (B.topLeftCorner<2, 3>() - predicted * B.row(2).head<3>()) * derivative;
  result.depth = q.z();
  return result;
}

}  // namespace

std::optional<Residual> forward(const Similarity& S_12, const Camera& camera_1,
                                const SimilarityMatch& match) {
  const Eigen::Vector3d p_1 = S_12 * match.point_2;
  return residual(p_1, moved_by_tangent(p_1), camera_1, match.pixel_1, match.inverse_sigma2_1);
}

std::optional<Residual> inverse(const Similarity& S_12, const Camera& camera_2,
                                const SimilarityMatch& match) {
  const Eigen::Matrix3d sR_21 = S_12.rotation_matrix().transpose() / S_12.scale();
  const Eigen::Vector3d p_2 = sR_21 * (match.point_1 - S_12.translation());
  return residual(p_2, -sR_21 * moved_by_tangent(match.point_1), camera_2, match.pixel_2,
                  match.inverse_sigma2_2);
}

}  // namespace orbslam::sim3_residuals
