// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/errors.hpp"

namespace orbslam {
namespace {

// Enough for the lenses of the field, and a fixed number keeps the result reproducible.
constexpr int kUndistortIterations = 5;

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
      throw SettingsError("distortion coefficients k1, k2, p1, p2, k3 must be finite, got " +
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

std::shared_ptr<const LensModel> make_lens(const std::array<double, 5>& coefficients) {
  auto lens = std::make_shared<RadialTangential>(coefficients);
  if (lens->is_identity()) return std::make_shared<NoDistortion>();
  return lens;
}

ImageBounds bounds_of(const LensModel& lens, const Pinhole& pinhole, ImageSize size) {
  const float width = static_cast<float>(size.width);
  const float height = static_cast<float>(size.height);
  if (lens.is_identity()) return {0, width, 0, height};

  // Corners in the order upper left, upper right, lower left, lower right.
  std::vector<float> xy = {0, 0, width, 0, 0, height, width, height};
  lens.undistort(pinhole, xy);
  const ImageBounds bounds{std::min(xy[0], xy[4]), std::max(xy[2], xy[6]), std::min(xy[1], xy[3]),
                           std::max(xy[5], xy[7])};
  if (!(bounds.min_x < bounds.max_x && bounds.min_y < bounds.max_y)) {
    throw SettingsError(
        "the distortion coefficients fold the image corners over each other; "
        "check k1, k2, p1, p2, k3 and the focal lengths");
  }
  return bounds;
}

}  // namespace

bool RadialTangential::is_identity() const {
  return std::all_of(coefficients_.begin(), coefficients_.end(), [](double c) { return c == 0; });
}

// D. C. Brown, "Close-range camera calibration", 1971: the lens moves the point (x, y) of the
// pinhole, at unit depth, to (x, y) * radial + tangential. What it was moved from is the fixed
// point of the step below, and OpenCV searches it in the same way: the operations stand in the same
// order, so that coordinates are those of its undistortPoints, to the bit.
void RadialTangential::undistort(const Pinhole& pinhole, std::vector<float>& xy) const {
  if (is_identity()) return;
  const auto [k1, k2, p1, p2, k3] = coefficients_;
  const double inverse_fx = 1 / pinhole.fx, inverse_fy = 1 / pinhole.fy;
  for (std::size_t i = 0; i + 1 < xy.size(); i += 2) {
    const double seen_x = (xy[i] - pinhole.cx) * inverse_fx;
    const double seen_y = (xy[i + 1] - pinhole.cy) * inverse_fy;
    double x = seen_x, y = seen_y;
    for (int iteration = 0; iteration < kUndistortIterations; ++iteration) {
      const double r2 = x * x + y * y;
      const double inverse_radial = 1 / (1 + ((k3 * r2 + k2) * r2 + k1) * r2);
      if (inverse_radial < 0) {  // the model folds the image over out there: nothing fits
        x = seen_x;
        y = seen_y;
        break;
      }
      const double tangential_x = 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
      const double tangential_y = p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
      x = (seen_x - tangential_x) * inverse_radial;
      y = (seen_y - tangential_y) * inverse_radial;
    }
    xy[i] = static_cast<float>(pinhole.fx * x + pinhole.cx);
    xy[i + 1] = static_cast<float>(pinhole.fy * y + pinhole.cy);
  }
}

Camera::Camera(const CameraOptions& options)
    : options_(options),
      pinhole_(options.pinhole),
      image_size_(options.image_size),
      bf_(options.bf) {
  check(options);
  lens_ = make_lens(options.distortion);
  bounds_ = bounds_of(*lens_, pinhole_, image_size_);
  if (has_baseline()) close_depth_ = bf_ * options.depth_ratio / pinhole_.fx;
}

}  // namespace orbslam
