// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "base/pose.hpp"
#include "frame/frame.hpp"
#include "map/point_batch.hpp"

namespace orbslam {

/// Image of a world point: pixel, and column in the (virtual) right image.
struct ImagePoint {
  double u = 0, v = 0, right_u = 0;
};

/// Projects many world points into one frame, which must outlive it; points that its camera cannot
/// see are refused.
/// All tests are written so that NaN fails them. See
/// docs/method/tracking.md#matching-the-local-map.
class Projector {
 public:
  Projector(const Frame& frame, const Pose& T_cw)
      : rotation_(T_cw.rotation_matrix()),
        translation_(T_cw.translation()),
        center_(T_cw.center()),
        camera_(*frame.camera) {}

  /// Centre (world) of the camera that sees a point at `image`.
  Eigen::Vector3d center(const ImagePoint& image) const {
    if (!camera_.is_rig()) return center_;
    return rotation_.transpose() * (camera_.centre(image.u) - translation_);
  }

  /// Frames accept both ends of the image bounds.
  bool project_into_frame(const Eigen::Vector3d& p_w, ImagePoint& image) const {
    return project(p_w, image) && camera_.bounds().contains(image.u, image.v);
  }
  /// Keyframes exclude the upper ends.
  bool project_into_keyframe(const Eigen::Vector3d& p_w, ImagePoint& image) const {
    return project(p_w, image) && camera_.bounds().contains_half_open(image.u, image.v);
  }

 private:
  bool project(const Eigen::Vector3d& p_w, ImagePoint& image) const {
    const Eigen::Vector3d p_c(rotation_.row(0).dot(p_w) + translation_.x(),
                              rotation_.row(1).dot(p_w) + translation_.y(),
                              rotation_.row(2).dot(p_w) + translation_.z());
    Eigen::Vector2d uv;
    double disparity = 0;
    if (!camera_.project(p_c, uv, disparity)) return false;
    image.u = uv.x();
    image.v = uv.y();
    image.right_u = image.u - disparity;
    return true;
  }

  Eigen::Matrix3d rotation_;
  Eigen::Vector3d translation_, center_;
  const Camera& camera_;
};

inline constexpr double kNearestFactor = 0.8;   ///< of a point's min_distance
inline constexpr double kFarthestFactor = 1.2;  ///< of a point's max_distance

/// Whether a point at `distance` can be seen on the levels of the pyramid (20 % slack).
inline bool in_scale_range(double distance, double min_distance, double max_distance) {
  return distance >= kNearestFactor * min_distance && distance <= kFarthestFactor * max_distance;
}

/// Whether a point is seen from at most 60 degrees off its mean viewing direction; `along` is the
/// part of the ray from the camera in that direction.
inline bool seen_from_near_direction(double along, double distance) {
  constexpr double kLeastViewCosine = 0.5;
  return along >= kLeastViewCosine * distance;
}

/// Predicted pixel and pyramid level of a point in a keyframe.
struct ExpectedView {
  ImagePoint image;
  int level = 0;
};

/// The view of a point of the batch; false when it is out of sight, at a scale it was not seen at,
/// or more than 60 degrees from its mean viewing direction.
inline bool expect_in_keyframe(const Projector& projector, const Frame& frame,
                               const PointBatch& points, std::size_t i, ExpectedView& view) {
  if (!projector.project_into_keyframe(points.positions[i], view.image)) return false;
  const Eigen::Vector3d ray = points.positions[i] - projector.center(view.image);
  const double distance = ray.norm();
  if (!in_scale_range(distance, points.min_distances[i], points.max_distances[i])) return false;
  if (!seen_from_near_direction(ray.dot(points.mean_directions[i]), distance)) return false;
  view.level = frame.scales->predict_level(points.max_distances[i], distance);
  return true;
}

}  // namespace orbslam
