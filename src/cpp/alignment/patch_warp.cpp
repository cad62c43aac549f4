// SPDX-License-Identifier: BSD-3-Clause
#include "alignment/patch_warp.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace orbslam {
namespace {

/// Step of the differences [pixels]: half a patch, so that the bend of the lens over the patch is
/// averaged.
constexpr double kStep = 4;
/// A plane that shrinks more than that is seen edge-on.
constexpr double kLeastMagnification = 1e-3;

Eigen::Vector3d point_behind(const Camera& camera, const Eigen::Vector2d& raw, double z) {
  if (!camera.distorts()) return camera.unproject(raw.x(), raw.y(), z);
  const Eigen::Vector2f straight = camera.from_image(raw.cast<float>());
  return camera.unproject(straight.x(), straight.y(), z);
}

/// Derivative of the raw pixel by the undistorted one.
Eigen::Matrix2d lens_derivative(const Camera& camera, const Eigen::Vector2d& uv) {
  Eigen::Matrix2d J;
  for (int k = 0; k < 2; ++k) {
    const Eigen::Vector2d step = kStep * Eigen::Vector2d::Unit(k);
    J.col(k) = (camera.to_image(uv + step) - camera.to_image(uv - step)) / (2 * kStep);
  }
  return J;
}

}  // namespace

std::optional<SurfacePatch> parallel_patch(const Camera& camera, const Pose& T_wc,
                                           const Eigen::Vector2d& pixel, double z) {
  if (!(z > 0)) return std::nullopt;
  SurfacePatch patch;
  patch.point = T_wc * point_behind(camera, pixel, z);
  const Eigen::Matrix3d R_wc = T_wc.rotation_matrix();
  for (int k = 0; k < 2; ++k) {
    const Eigen::Vector2d step = kStep * Eigen::Vector2d::Unit(k);
    const Eigen::Vector3d difference =
        point_behind(camera, pixel + step, z) - point_behind(camera, pixel - step, z);
    patch.per_pixel.col(k) = R_wc * (difference / (2 * kStep));
  }
  if (!(patch.point.allFinite() && patch.per_pixel.allFinite())) return std::nullopt;
  return patch;
}

std::optional<PatchWarp> warp_of(const SurfacePatch& patch, const Camera& camera,
                                 const Pose& T_cw) {
  Seen seen;
  if (!camera.project(T_cw * patch.point, seen)) return std::nullopt;
  PatchWarp warp{camera.to_image(seen.uv), seen.J * T_cw.rotation_matrix() * patch.per_pixel};
  if (camera.distorts()) warp.A = lens_derivative(camera, seen.uv) * warp.A;
  const bool usable = warp.pixel.allFinite() && warp.A.allFinite() &&
                      std::abs(warp.A.determinant()) > kLeastMagnification;
  if (!usable) return std::nullopt;
  return warp;
}

int warped_level(const ScalePyramid& scales, int reference_level, const Eigen::Matrix2d& A) {
  const double magnification = std::sqrt(std::abs(A.determinant()));
  const double steps = std::log(magnification) / static_cast<double>(scales.log_factor());
  if (!std::isfinite(steps)) return reference_level;
  const double level = std::round(reference_level + steps);
  return static_cast<int>(std::clamp<double>(level, 0, scales.levels() - 1));
}

}  // namespace orbslam
