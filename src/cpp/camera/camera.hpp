// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "base/scale_pyramid.hpp"

namespace orbslam {

/// Pinhole intrinsics in pixels. Everything behind the frame works on undistorted pixels, so
/// matching and optimisation know no other projection.
struct Pinhole {
  double fx = 0, fy = 0, cx = 0, cy = 0;

  /// (u, v) of a point in the camera frame; its z must not be 0.
  Eigen::Vector2d project(const Eigen::Vector3d& p_c) const {
    const double inverse_z = 1.0 / p_c.z();
    return {fx * p_c.x() * inverse_z + cx, fy * p_c.y() * inverse_z + cy};
  }
  /// The calibration matrix K.
  Eigen::Matrix3d matrix() const {
    Eigen::Matrix3d K;
    K << fx, 0, cx, 0, fy, cy, 0, 0, 1;
    return K;
  }
  /// The point at depth z [m] seen at pixel (u, v).
  Eigen::Vector3d unproject(double u, double v, double z) const {
    return {(u - cx) * z / fx, (v - cy) * z / fy, z};
  }
};

/// How raw pixels become pixels of the pinhole. New lenses (fisheye) implement this interface.
class LensModel {
 public:
  virtual ~LensModel() = default;
  virtual bool is_identity() const = 0;
  /// Replaces raw pixel coordinates by undistorted ones (interleaved x, y).
  virtual void undistort(const Pinhole& pinhole, std::vector<float>& xy) const = 0;
};

/// The lens of rectified images.
class NoDistortion final : public LensModel {
 public:
  bool is_identity() const override { return true; }
  void undistort(const Pinhole&, std::vector<float>&) const override {}
};

/// OpenCV's coefficients k1, k2, p1, p2, k3, and k4, k5, k6 of the rational model; zeros: unused.
using Distortion = std::array<double, 8>;

/// OpenCV's radial-tangential lens: with k4, k5 or k6 the rational model.
class RadialTangential final : public LensModel {
 public:
  explicit RadialTangential(const Distortion& coefficients) : coefficients_(coefficients) {}
  bool is_identity() const override;
  void undistort(const Pinhole& pinhole, std::vector<float>& xy) const override;

 private:
  void undistort_rational(const Pinhole& pinhole, std::vector<float>& xy) const;

  Distortion coefficients_;
};

/// Limits of undistorted pixel coordinates.
struct ImageBounds {
  float min_x = 0, max_x = 0, min_y = 0, max_y = 0;

  /// Frames accept both ends.
  bool contains(double u, double v) const {
    return u >= min_x && u <= max_x && v >= min_y && v <= max_y;
  }
  /// Keyframes exclude the upper ends.
  bool contains_half_open(double u, double v) const {
    return u >= min_x && u < max_x && v >= min_y && v < max_y;
  }
};

struct CameraOptions {
  Pinhole pinhole;
  Distortion distortion{};  ///< k1, k2, p1, p2, k3, k4, k5, k6; all zero for rectified images
  double bf = 0;                       ///< baseline times fx [pixel metre]; 0 for a single camera
  double depth_ratio = 0;              ///< close/far limit in multiples of the baseline (ThDepth)
  ImageSize image_size;                ///< of the first image
};

/// A calibrated camera: pinhole, lens, (virtual) right camera and the image bounds that follow
/// from them. Immutable, shared by all frames of a system; nothing of it is global.
class Camera {
 public:
  /// Throws SettingsError when a focal length or the image size is not positive, a coefficient is
  /// not finite, bf is negative, or there is a baseline without a positive depth_ratio.
  explicit Camera(const CameraOptions& options);

  const CameraOptions& options() const { return options_; }
  const Pinhole& pinhole() const { return pinhole_; }
  const LensModel& lens() const { return *lens_; }
  const ImageBounds& bounds() const { return bounds_; }
  ImageSize image_size() const { return image_size_; }

  bool has_baseline() const { return bf_ > 0; }
  double bf() const { return bf_; }                      ///< pixel metre
  double baseline() const { return bf_ / pinhole_.fx; }  ///< metres
  /// Depths below this [m] are trusted from one view; infinite without a baseline.
  double close_depth() const { return close_depth_; }

  /// Column in the (virtual) right image of a point at column u and depth z.
  double right_column(double u, double z) const { return u - bf_ / z; }

 private:
  CameraOptions options_;
  Pinhole pinhole_;
  std::shared_ptr<const LensModel> lens_;
  ImageBounds bounds_;
  ImageSize image_size_;
  double bf_ = 0;
  double close_depth_ = std::numeric_limits<double>::infinity();
};

}  // namespace orbslam
