// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <memory>
#include <vector>

#include "base/pose.hpp"
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

class Camera;

/// A camera of a rig, and how it is mounted.
struct RigMember {
  std::shared_ptr<const Camera> camera;
  Pose T_bc;  ///< camera to body coordinates [m]
  /// True: points are searched in its image. False: it has no image, or its image only gives depths
  /// to another camera.
  bool active = true;
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
  /// The cameras of a rig, two or more; everything above is then taken from them.
  std::vector<RigMember> members;
};

/// Linear forms q = B (p; 1) that compare a point p in the camera frame with one keypoint: the
/// error of its projection in raw pixels is (q.x, q.y) / q.z, exact for a pinhole and to first
/// order around the keypoint for other lenses. q.z is positive in front, that is within 90 degrees
/// of the keypoint's ray or of a pinhole's axis. The last column is zero but for the cameras of a
/// rig.
///
/// Its disparity is bf / q.z, and B.row(0) points along the epipolar curve in the direction in
/// which the right camera of a pair sees it (docs/method/frame.md#depth-of-a-sight).
using Sight = Eigen::Matrix<double, 3, 4>;

/// The values q of the forms.
inline Eigen::Vector3d apply(const Sight& B, const Eigen::Vector3d& p) {
  return B.leftCols<3>() * p + B.col(3);
}

/// Number k of a sight as the solvers store it: rows of three, then the last column.
inline double sight_entry(const Sight& B, std::size_t k) {
  return k < 9 ? B(static_cast<int>(k / 3), static_cast<int>(k % 3))
               : B(static_cast<int>(k - 9), 3);
}

/// A calibrated camera, which owns its image plane: projection, lens, bounds and (virtual) right
/// camera. Keypoints are pixels of this plane. Of a pinhole it is flat, without the distortion of
/// the lens; of a fisheye lens it is the image itself. Pixels of the image are called raw.
///
/// A rig of several cameras is a camera as well: its plane holds the planes of all its cameras side
/// by side, and its frame is that of the body. The column of a pixel tells the camera. See
/// docs/method/frame.md#rigs.
///
/// Immutable, and shared by all frames of a system.
class Camera {
 public:
  /// Fraction of the disparity in the middle of the image, below which a keypoint of a fisheye pair
  /// gets no depth, because its ray is nearly parallel to the baseline.
  static constexpr double kLeastShift = 0.2;
  /// Columns between the planes of two cameras of a rig: more than any search window.
  static constexpr int kRigGap = 256;

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
  /// Several cameras.
  bool is_rig() const { return rig_; }
  /// Of a rig; 1 otherwise.
  std::size_t n_cameras() const { return rig_ ? slots_.size() : 1; }
  /// Of a rig: the camera that column u belongs to; 0 otherwise.
  std::size_t camera_at(double u) const { return rig_ ? slot_at(u) : 0; }
  const std::vector<RigMember>& members() const { return options_.members; }
  /// Column of a rig's plane at which the column 0 of a camera lies.
  double column_of(std::size_t camera) const { return rig_ ? slots_[camera].column : 0; }
  /// Where the camera that column u belongs to is, in the frame of the body; zero for one camera.
  Eigen::Vector3d centre(double u) const {
    return rig_ ? slots_[slot_at(u)].centre : Eigen::Vector3d::Zero();
  }
  /// The pixel at which one camera of a rig sees a point, inside or outside its image.
  bool project_into(std::size_t camera, const Eigen::Vector3d& p_b, Eigen::Vector2d& uv) const;
  /// The same rig with other active cameras.
  Camera with_active(const std::vector<bool>& active) const;
  /// Of a flat plane. For a fisheye lens: the pinhole with its scale in the middle.
  const Pinhole& pinhole() const { return options_.pinhole; }
  /// Pixel of a point in the camera frame. False, and `uv` stays, for a point outside of the
  /// model's domain (of a pinhole: in front of the camera), or with NaN. Image bounds are not
  /// checked. For a rig, the active camera is used in whose image the point is most central.
  bool project(const Eigen::Vector3d& p_c, Eigen::Vector2d& uv) const {
    if (!flat_) return project_wide(p_c, uv);
    if (!(p_c.z() > 0)) return false;
    uv = pinhole().project(p_c);
    return true;
  }
  /// The same with the disparity.
  bool project(const Eigen::Vector3d& p_c, Eigen::Vector2d& uv, double& disparity) const {
    if (!flat_) return project_wide(p_c, uv, disparity);
    if (!project(p_c, uv)) return false;
    disparity = bf() * (1.0 / p_c.z());
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
    if (rig_) return unproject_in_rig(u, v, depth);
    return wide_ray(u, v) * depth;
  }
  /// Compares points with a keypoint at pixel (u, v) of the plane.
  Sight sight(double u, double v) const;
  /// Error of a point's projection against a keypoint, in raw pixels. False outside of the domain.
  bool error(const Eigen::Vector3d& p_c, double u, double v, Eigen::Vector2d& error) const {
    if (rig_) return error_in_rig(p_c, u, v, error);
    Eigen::Vector2d uv;
    if (!project(p_c, uv)) return false;
    error = raw_error(uv - Eigen::Vector2d(u, v), u, v);
    return true;
  }
  /// Converts a small pixel difference at (u, v) from the plane to raw pixels.
  Eigen::Vector2d raw_error(const Eigen::Vector2d& difference, double u, double v) const {
    if (rig_) return slot(u).camera->raw_error(difference, u - slot(u).column, v);
    return distorts_ ? Eigen::Vector2d(raw_by_plane(u, v) * difference) : difference;
  }
  /// Error of a point's (virtual) right column against that of a keypoint at (u, v), given the
  /// error of its pixel.
  double right_error(const Eigen::Vector3d& p_c, const Eigen::Vector2d& error, double u, double v,
                     double right_u) const {
    if (flat_) return error.x() + (u - right_u) - options_.bf / p_c.z();
    const Eigen::Vector3d q = apply(sight(u, v), p_c);
    return q.x() / q.z() + (u - right_u) - options_.bf / q.z();
  }
  /// The part of a pixel error at (u, v) along the line on which the right camera sees the
  /// keypoint.
  double along_epipolar_curve(const Eigen::Vector2d& error, double u, double v) const {
    if (rig_) return slot(u).camera->along_epipolar_curve(error, u - slot(u).column, v);
    return wide_pair_ ? along_curve_of_pair(error, u, v) : error.x();
  }
  /// Disparity [pixels] of a point in the (virtual) right camera; to first order in the inverse
  /// depth for a fisheye lens. The point must be in the domain.
  double disparity(const Eigen::Vector3d& p_c) const;
  /// The same for a keypoint at (u, v) with a depth as unproject() has it.
  double disparity(double u, double v, double depth) const;
  /// Depth of a keypoint at (u, v), as unproject() has it, from its depth along the optical axis
  /// [m]; 0 where the ray is nearly parallel to the image plane or looks backwards.
  double depth_of_axial(double u, double v, double z) const;
  /// Pixels that the image moves in its middle per radian that the camera turns.
  double pixels_per_radian() const { return pinhole().fx; }
  /// Limits of the pixels of the plane.
  const ImageBounds& bounds() const { return bounds_; }

  /// True if the plane is not the image, because the lens distorts.
  bool distorts() const { return distorts_; }
  /// Pixel of the plane of a raw one. A raw pixel stays unchanged where the lens model folds over,
  /// because the lens shows nothing there.
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
  /// The same of the camera that column u belongs to.
  double close_depth(double u) const { return rig_ ? slot(u).camera->close_depth() : close_depth_; }

  /// Column in the (virtual) right image of a point at column u and depth z; of a flat plane.
  double right_column(double u, double z) const { return u - options_.bf / z; }

 private:
  /// Where a camera of a rig is, in the body and in the plane.
  struct Slot {
    const Camera* camera;
    Eigen::Matrix3d R_cb, R_bc;
    Eigen::Vector3d t_cb, centre;
    double column;  ///< of the plane, where column 0 of the camera lies
    double end;     ///< of the columns that belong to the camera
    double scale;   ///< of its sights: bf of the rig over its own
    bool active;
  };
  std::size_t slot_at(double u) const {
    std::size_t i = 0;
    while (i + 1 < slots_.size() && u >= slots_[i].end) ++i;
    return i;
  }
  const Slot& slot(double u) const { return slots_[slot_at(u)]; }
  static std::vector<Slot> slots_of(const CameraOptions& options);
  /// The active camera of a rig in whose image a point is most central; null if no camera sees it.
  const Slot* looking_at(const Eigen::Vector3d& p_b, Eigen::Vector3d& p_c,
                         Eigen::Vector2d& uv) const;
  Eigen::Vector3d unproject_in_rig(double u, double v, double depth) const;
  bool error_in_rig(const Eigen::Vector3d& p_b, double u, double v, Eigen::Vector2d& error) const;
  bool project_wide(const Eigen::Vector3d& p_c, Eigen::Vector2d& uv) const;
  bool project_wide(const Eigen::Vector3d& p_c, Eigen::Vector2d& uv, double& disparity) const;
  Eigen::Vector3d wide_ray(double u, double v) const;
  Eigen::Matrix3d sight_of_one(double u, double v) const;
  Sight sight_of_rig(double u, double v) const;
  double along_curve_of_pair(const Eigen::Vector2d& error, double u, double v) const;
  /// Derivative of a raw pixel by the pixel of the flat plane.
  Eigen::Matrix2d raw_by_plane(double u, double v) const;

  CameraOptions options_;
  LensModel lens_;
  std::vector<Slot> slots_;  ///< of a rig
  bool rig_, flat_, distorts_, wide_pair_;
  ImageBounds bounds_;
  double close_depth_ = std::numeric_limits<double>::infinity();
};

}  // namespace orbslam
