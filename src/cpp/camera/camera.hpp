// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <limits>

#include "base/scale_pyramid.hpp"
#include "camera/lens.hpp"
#include "camera/pinhole.hpp"

namespace orbslam {

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
  double bf = 0;            ///< baseline times fx [pixel metre]; 0 for a single camera
  double depth_ratio = 0;   ///< close/far limit in multiples of the baseline (ThDepth)
  ImageSize image_size;     ///< of the first image
};

/// A calibrated camera, which owns its image plane: projection, lens, bounds and (virtual) right
/// camera. The plane has undistorted pixels; those of the image itself are called raw. Immutable,
/// shared by all frames of a system; nothing of it is global.
class Camera {
 public:
  /// Throws SettingsError when a focal length or the image size is not positive, a coefficient is
  /// not finite, bf is negative, or there is a baseline without a positive depth_ratio.
  explicit Camera(const CameraOptions& options);

  const CameraOptions& options() const { return options_; }
  ImageSize image_size() const { return options_.image_size; }

  /// What the image plane is made of, for algorithms of the pinhole alone.
  const Pinhole& pinhole() const { return options_.pinhole; }
  /// Pixel of a point in the camera frame. False, and `uv` stays, for a point that cannot be seen:
  /// one that is not in front of the camera, or with NaN for its depth. Bounds are not asked.
  bool project(const Eigen::Vector3d& p_c, Eigen::Vector2d& uv) const {
    if (!can_see(p_c)) return false;
    uv = pinhole().project(p_c);
    return true;
  }
  /// The same with the derivative.
  bool project(const Eigen::Vector3d& p_c, Seen& seen) const;
  /// The point is where the projection is defined.
  bool can_see(const Eigen::Vector3d& p_c) const { return p_c.z() > 0; }
  /// Direction in which pixel (u, v) looks, as the point at depth 1.
  Eigen::Vector3d ray(double u, double v) const { return pinhole().unproject(u, v, 1.0); }
  /// The point at depth z [m] along the optical axis, seen at pixel (u, v).
  Eigen::Vector3d unproject(double u, double v, double z) const {
    return pinhole().unproject(u, v, z);
  }
  /// Pixels that the image moves in its middle per radian that the camera turns.
  double pixels_per_radian() const { return pinhole().fx; }
  /// What undistorted pixels of the image can be.
  const ImageBounds& bounds() const { return bounds_; }

  /// The lens bends: raw pixels and those of the plane differ.
  bool distorts() const { return lens_.distorts(); }
  /// Undistorted pixel of a raw one; the same one without a lens. A raw pixel at which the lens can
  /// show nothing, because its model folds over there, stays as it is.
  Eigen::Vector2f from_image(const Eigen::Vector2f& raw) const;
  /// Raw pixel of an undistorted one.
  Eigen::Vector2d to_image(const Eigen::Vector2d& uv) const;

  bool has_baseline() const { return options_.bf > 0; }
  double bf() const { return options_.bf; }                       ///< pixel metre
  double baseline() const { return options_.bf / pinhole().fx; }  ///< metres
  /// Depths below this [m] are trusted from one view; infinite without a baseline.
  double close_depth() const { return close_depth_; }

  /// Column in the (virtual) right image of a point at column u and depth z.
  double right_column(double u, double z) const { return u - options_.bf / z; }

 private:
  CameraOptions options_;
  Lens lens_;
  ImageBounds bounds_;
  double close_depth_ = std::numeric_limits<double>::infinity();
};

}  // namespace orbslam
