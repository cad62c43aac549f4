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
  if (!(std::abs(p_c.z()) > kTinyDepth)) return std::nullopt;
  const double weight = std::sqrt(inverse_sigma2), inverse_z = 1 / p_c.z();
  // Behind the camera as well: an adjustment may lead a point through its plane and back.
  const Pinhole& pinhole = camera.pinhole();
  Eigen::Matrix<double, 2, 3> projection;
  projection << pinhole.fx, 0, -pinhole.fx * p_c.x() * inverse_z,  //
      0, pinhole.fy, -pinhole.fy * p_c.y() * inverse_z;
  Residual result;
  result.error = weight * (pixel - pinhole.project(p_c));
  result.jacobian = -weight * inverse_z * projection * derivative;
  result.depth = p_c.z();
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
