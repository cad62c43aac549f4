// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/errors.hpp"

namespace orbslam {
namespace {

bool positive(double value) { return std::isfinite(value) && value > 0; }

void check(const CameraOptions& options) {
  const Pinhole& k = options.pinhole;
  if (!positive(k.fx) || !positive(k.fy)) {
    throw SettingsError("focal lengths Camera.fx and Camera.fy must be positive, got " +
                        std::to_string(k.fx) + " and " + std::to_string(k.fy));
  }
  if (!std::isfinite(k.cx) || !std::isfinite(k.cy)) {
    throw SettingsError("principal point Camera.cx, Camera.cy must be finite, got " +
                        std::to_string(k.cx) + " and " + std::to_string(k.cy));
  }
  if (options.image_size.width < 1 || options.image_size.height < 1) {
    throw SettingsError("image size must be positive, got " +
                        std::to_string(options.image_size.width) + "x" +
                        std::to_string(options.image_size.height));
  }
  for (const double coefficient : options.distortion) {
    if (!std::isfinite(coefficient)) {
      throw SettingsError("distortion coefficients k1, k2, p1, p2, k3 to k6 must be finite, got " +
                          std::to_string(coefficient));
    }
  }
  if (!std::isfinite(options.bf) || options.bf < 0) {
    throw SettingsError("Camera.bf (baseline times fx) must not be negative, got " +
                        std::to_string(options.bf));
  }
  if (options.bf > 0 && !positive(options.depth_ratio)) {
    throw SettingsError("ThDepth (close/far limit in baselines) must be positive, got " +
                        std::to_string(options.depth_ratio));
  }
}

ImageBounds bounds_of(const Camera& camera) {
  const auto width = static_cast<float>(camera.image_size().width);
  const auto height = static_cast<float>(camera.image_size().height);
  if (!camera.distorts()) return {0, width, 0, height};

  const Eigen::Vector2f upper_left = camera.from_image({0, 0});
  const Eigen::Vector2f upper_right = camera.from_image({width, 0});
  const Eigen::Vector2f lower_left = camera.from_image({0, height});
  const Eigen::Vector2f lower_right = camera.from_image({width, height});
  const ImageBounds bounds{
      std::min(upper_left.x(), lower_left.x()), std::max(upper_right.x(), lower_right.x()),
      std::min(upper_left.y(), upper_right.y()), std::max(lower_left.y(), lower_right.y())};
  if (!(bounds.min_x < bounds.max_x && bounds.min_y < bounds.max_y)) {
    throw SettingsError(
        "the distortion coefficients fold the image corners over each other; "
        "check k1, k2, p1, p2, k3 to k6 and the focal lengths");
  }
  return bounds;
}

const CameraOptions& checked(const CameraOptions& options) {
  check(options);
  return options;
}

}  // namespace

Camera::Camera(const CameraOptions& options)
    : options_(checked(options)), lens_(options.distortion), bounds_(bounds_of(*this)) {
  if (has_baseline()) close_depth_ = options.bf * options.depth_ratio / options.pinhole.fx;
}

bool Camera::project(const Eigen::Vector3d& p_c, Seen& seen) const {
  if (!project(p_c, seen.uv)) return false;
  const Pinhole& k = pinhole();
  const double inverse_z = 1 / p_c.z();
  seen.J << k.fx * inverse_z, 0, -k.fx * p_c.x() * inverse_z * inverse_z,  //
      0, k.fy * inverse_z, -k.fy * p_c.y() * inverse_z * inverse_z;
  return true;
}

Eigen::Vector2f Camera::from_image(const Eigen::Vector2f& raw) const {
  if (!distorts()) return raw;
  const Pinhole& k = pinhole();
  const double inverse_fx = 1 / k.fx, inverse_fy = 1 / k.fy;
  const Eigen::Vector2d straight =
      lens_.straight({(raw.x() - k.cx) * inverse_fx, (raw.y() - k.cy) * inverse_fy});
  return {static_cast<float>(k.fx * straight.x() + k.cx),
          static_cast<float>(k.fy * straight.y() + k.cy)};
}

Eigen::Vector2d Camera::to_image(const Eigen::Vector2d& uv) const {
  if (!distorts()) return uv;
  const Pinhole& k = pinhole();
  const Eigen::Vector2d bent = lens_.bent({(uv.x() - k.cx) / k.fx, (uv.y() - k.cy) / k.fy});
  return {k.fx * bent.x() + k.cx, k.fy * bent.y() + k.cy};
}

}  // namespace orbslam
