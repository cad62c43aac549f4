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

// Newton's steps for the rational model: they end sooner, when a step is below the tolerance.
constexpr int kMostNewtonSteps = 30;
constexpr double kNewtonTolerance = 1e-12;

/// Where the lens moves a point at unit depth, and by how much per shift of the point.
struct Moved {
  double x, y;
  double x_by_x, x_by_y, y_by_y;  // y_by_x equals x_by_y
};

Moved through_lens(const Distortion& coefficients, double x, double y) {
  const auto [k1, k2, p1, p2, k3, k4, k5, k6] = coefficients;
  const double r2 = x * x + y * y;
  const double numerator = 1 + ((k3 * r2 + k2) * r2 + k1) * r2;
  const double denominator = 1 + ((k6 * r2 + k5) * r2 + k4) * r2;
  const double radial = numerator / denominator;
  const double numerator_by_r2 = (3 * k3 * r2 + 2 * k2) * r2 + k1;
  const double denominator_by_r2 = (3 * k6 * r2 + 2 * k5) * r2 + k4;
  const double radial_by_r2 = (numerator_by_r2 - radial * denominator_by_r2) / denominator;
  return {x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
          y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
          radial + 2 * x * x * radial_by_r2 + 2 * p1 * y + 6 * p2 * x,
          2 * x * y * radial_by_r2 + 2 * p1 * x + 2 * p2 * y,
          radial + 2 * y * y * radial_by_r2 + 6 * p1 * y + 2 * p2 * x};
}

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

std::shared_ptr<const LensModel> make_lens(const Distortion& coefficients) {
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
        "check k1, k2, p1, p2, k3 to k6 and the focal lengths");
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
  const auto [k1, k2, p1, p2, k3, k4, k5, k6] = coefficients_;
  if (k4 != 0 || k5 != 0 || k6 != 0) {
    undistort_rational(pinhole, xy);
    return;
  }
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

// The rational model of OpenCV's calib3d; Newton's method from the seen point on. A point that it
// cannot reach, where the model folds the image over, stays where it was seen.
void RadialTangential::undistort_rational(const Pinhole& pinhole, std::vector<float>& xy) const {
  for (std::size_t i = 0; i + 1 < xy.size(); i += 2) {
    const double seen_x = (xy[i] - pinhole.cx) / pinhole.fx;
    const double seen_y = (xy[i + 1] - pinhole.cy) / pinhole.fy;
    double x = seen_x, y = seen_y;
    bool reached = false;
    for (int step = 0; step < kMostNewtonSteps && !reached; ++step) {
      const Moved moved = through_lens(coefficients_, x, y);
      const double off_x = moved.x - seen_x, off_y = moved.y - seen_y;
      reached = std::abs(off_x) + std::abs(off_y) < kNewtonTolerance;
      const double determinant = moved.x_by_x * moved.y_by_y - moved.x_by_y * moved.x_by_y;
      if (!(determinant > 0)) break;
      x -= (moved.y_by_y * off_x - moved.x_by_y * off_y) / determinant;
      y -= (moved.x_by_x * off_y - moved.x_by_y * off_x) / determinant;
    }
    if (!reached) continue;
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
