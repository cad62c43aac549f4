// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <limits>
#include <memory>

#include "base/scale_pyramid.hpp"
#include "camera/bend.hpp"
#include "camera/camera_model.hpp"
#include "camera/pinhole.hpp"

namespace orbslam {

/// Limits of the image plane's pixel coordinates.
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
  /// Any camera model, in place of `pinhole` and `distortion`; none: these two.
  std::shared_ptr<const CameraModel> model;
  /// Centre of the right camera of a fisheye pair in the frame of this one [m]; it replaces `bf`.
  /// Zero: a rectified pair, a camera with depth images, or a single camera.
  Eigen::Vector3d right_centre = Eigen::Vector3d::Zero();
};

/// Linear forms that compare a point p in the camera frame with one keypoint: the error of its
/// projection in raw pixels is (B.row(0) p, B.row(1) p) / (B.row(2) p), exact for a pinhole and to
/// first order around the keypoint for other lenses. B.row(2) p is positive in front, that is
/// within 90 degrees of the keypoint's ray or of a pinhole's axis.
///
/// Its disparity is bf / (B.row(2) p), and B.row(0) points along the epipolar curve in the
/// direction in which the right camera of a pair sees it (docs/method/frame.md#depth-of-a-sight).
using Sight = Eigen::Matrix3d;

/// A calibrated camera, which owns its image plane: projection, lens, bounds and (virtual) right
/// camera. Keypoints are pixels of this plane. Of a pinhole it is flat, without the distortion of
/// the lens; of a fisheye lens it is the image itself. Pixels of the image are called raw.
/// Immutable, shared by all frames of a system; nothing of it is global.
class Camera {
 public:
  /// Part of the disparity in the middle below which a keypoint of a fisheye pair has no depth: it
  /// looks along the baseline.
  static constexpr double kLeastShift = 0.2;

  /// Throws SettingsError when a focal length or the image size is not positive, a coefficient is
  /// not finite, bf is negative, there is a baseline without a positive depth_ratio, or the model
  /// is of another image size.
  explicit Camera(const CameraOptions& options);

  const CameraOptions& options() const { return options_; }
  ImageSize image_size() const { return options_.image_size; }

  /// The image plane is that of a pinhole. Otherwise it is the image of a fisheye lens.
  bool is_flat() const { return flat_; }
  /// The image itself is that of a pinhole: its errors need no Sight.
  bool is_pinhole() const { return flat_ && !distorts_; }
  /// Of a flat plane. For a fisheye lens: the pinhole with its scale in the middle.
  const Pinhole& pinhole() const { return options_.pinhole; }
  /// Pixel of a point in the camera frame. False, and `uv` stays, for a point outside of the
  /// model's domain (of a pinhole: in front of the camera), or with NaN. Bounds are not asked.
  bool project(const Eigen::Vector3d& p_c, Eigen::Vector2d& uv) const {
    if (!flat_) return project_wide(p_c, uv);
    if (!(p_c.z() > 0)) return false;
    uv = pinhole().project(p_c);
    return true;
  }
  /// The same with the derivative.
  bool project(const Eigen::Vector3d& p_c, Seen& seen) const;
  /// Direction in which pixel (u, v) looks: of a flat plane the point at depth 1, otherwise a unit
  /// vector; NaN where a fisheye lens shows nothing.
  Eigen::Vector3d ray(double u, double v) const {
    return flat_ ? pinhole().unproject(u, v, 1.0) : wide_ray(u, v);
  }
  /// The point at a depth [m], seen at pixel (u, v). The depth of a flat plane is along the optical
  /// axis, that of a fisheye lens along the ray.
  Eigen::Vector3d unproject(double u, double v, double depth) const {
    if (flat_) return pinhole().unproject(u, v, depth);
    return wide_ray(u, v) * depth;
  }
  /// Compares points with a keypoint at pixel (u, v) of the plane.
  Sight sight(double u, double v) const;
  /// Error of a point's projection against a keypoint, in raw pixels. False outside of the domain.
  bool error(const Eigen::Vector3d& p_c, double u, double v, Eigen::Vector2d& error) const {
    Eigen::Vector2d uv;
    if (!project(p_c, uv)) return false;
    error = raw_error(uv - Eigen::Vector2d(u, v), u, v);
    return true;
  }
  /// Converts a small pixel difference at (u, v) from the plane to raw pixels.
  Eigen::Vector2d raw_error(const Eigen::Vector2d& difference, double u, double v) const {
    return distorts_ ? Eigen::Vector2d(raw_by_plane(u, v) * difference) : difference;
  }
  /// Error of a point's (virtual) right column against that of a keypoint at (u, v), given the
  /// error of its pixel.
  double right_error(const Eigen::Vector3d& p_c, const Eigen::Vector2d& error, double u, double v,
                     double right_u) const {
    if (flat_) return error.x() + (u - right_u) - options_.bf / p_c.z();
    const Eigen::Vector3d q = sight(u, v) * p_c;
    return q.x() / q.z() + (u - right_u) - options_.bf / q.z();
  }
  /// The part of a pixel error at (u, v) along the line on which the right camera sees the
  /// keypoint.
  double along_epipolar_curve(const Eigen::Vector2d& error, double u, double v) const {
    return wide_pair_ ? along_curve_of_pair(error, u, v) : error.x();
  }
  /// Pixels by which the (virtual) right camera sees a point shifted; to first order in the inverse
  /// depth for a fisheye lens. The point must be in the domain.
  double disparity(const Eigen::Vector3d& p_c) const;
  /// The same for a keypoint at (u, v) with a depth as unproject() has it.
  double disparity(double u, double v, double depth) const;
  /// Depth of a keypoint at (u, v), as unproject() has it, from its depth along the optical axis
  /// [m]; 0 where the ray is nearly parallel to the image plane or looks backwards.
  double depth_of_axial(double u, double v, double z) const;
  /// Pixels that the image moves in its middle per radian that the camera turns.
  double pixels_per_radian() const { return pinhole().fx; }
  /// What pixels of the plane can be.
  const ImageBounds& bounds() const { return bounds_; }

  /// The plane is not the image: the lens bends what a pinhole would show.
  bool distorts() const { return distorts_; }
  /// Pixel of the plane of a raw one. A raw pixel at which the lens can show nothing, because its
  /// model folds over there, stays as it is.
  Eigen::Vector2f from_image(const Eigen::Vector2f& raw) const;
  /// The lens model assigns a direction to this raw pixel.
  bool shows(const Eigen::Vector2d& raw) const;
  /// The raw pixel of a pixel of the plane; NaN where the lens shows nothing.
  Eigen::Vector2d to_image(const Eigen::Vector2d& uv) const;

  bool has_baseline() const { return options_.bf > 0; }
  /// The camera is the left one of a fisheye pair.
  bool has_wide_pair() const { return wide_pair_; }
  double bf() const { return options_.bf; }                       ///< pixel metre
  double baseline() const { return options_.bf / pinhole().fx; }  ///< metres
  /// Depths below this [m] are trusted from one view; infinite without a baseline.
  double close_depth() const { return close_depth_; }

  /// Column in the (virtual) right image of a point at column u and depth z; of a flat plane.
  double right_column(double u, double z) const { return u - options_.bf / z; }

 private:
  bool project_wide(const Eigen::Vector3d& p_c, Eigen::Vector2d& uv) const;
  Eigen::Vector3d wide_ray(double u, double v) const;
  double along_curve_of_pair(const Eigen::Vector2d& error, double u, double v) const;
  /// How a raw pixel moves with one of the flat plane.
  Eigen::Matrix2d raw_by_plane(double u, double v) const;

  CameraOptions options_;
  LensModel lens_;
  bool flat_, distorts_, wide_pair_;
  ImageBounds bounds_;
  double close_depth_ = std::numeric_limits<double>::infinity();
};

}  // namespace orbslam
