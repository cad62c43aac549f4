// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <vector>

#include "base/pose.hpp"
#include "frame/frame.hpp"

namespace orbslam {

/// A velocity, constant in the axes of the camera: the motion over an interval. See
/// docs/method/tracking.md#motion-model.
struct Velocity {
  Pose step;           ///< motion over the interval, `T_cl`
  double seconds = 0;  ///< the interval; negative where frames are tracked backwards in time

  /// The motion over another interval; over more than a second, that over a second.
  Pose over(double interval) const;
  /// The velocity after the map was scaled by a factor.
  Velocity scaled(double factor) const;
};

/// The motion `T_cl` between two frames; none if either has no pose.
std::optional<Pose> motion_between(const TrackedFrame& last, const TrackedFrame& frame);

/// The velocity between two frames; none if either has no pose. With `consecutive`, also none
/// unless the second frame is the next image and no loop was closed between them.
std::optional<Velocity> velocity_between(const TrackedFrame& last, const TrackedFrame& frame,
                                         bool consecutive);

/// Sets the pose of a frame by constant velocity, or to the pose of the last frame without a
/// velocity. The pose is relative to the last frame's reference keyframe. Throws StateError when
/// the last frame has no pose.
void predict_pose(TrackedFrame& frame, const TrackedFrame& last, const Velocity* velocity);

/// The tangent (rotation, translation) from the pose of a frame to the predicted pose; none if
/// either frame has no pose.
std::optional<Vector6d> innovation(const TrackedFrame& frame, const TrackedFrame& last,
                                   const Velocity& velocity);

/// Difference between the pose of a frame and the predicted pose.
struct PoseChange {
  double turn = 0;  ///< radians
  double move = 0;  ///< between the centres
};

/// Zero without a pose of either frame, or without a velocity.
PoseChange change_from_prediction(const TrackedFrame& frame, const TrackedFrame& last,
                                  const Velocity* velocity);

/// Sources of pose errors that the residuals do not show.
struct HiddenErrors {
  const Velocity* velocity = nullptr;  ///< predicts the frame's pose
  const Pose* map_motion = nullptr;    ///< of the map under the last frame, since it was tracked
  double wrong_share = 0;              ///< probability that the prediction is right, not the pose
};

/// `factor` times a covariance, plus that of the motion of the map, and `wrong_share` times that of
/// the innovation.
Matrix6d stated_covariance(const Matrix6d& covariance, double factor, const TrackedFrame& frame,
                           const TrackedFrame& last, const HiddenErrors& hidden);

/// Number of inliers of a frame that are still in the image after a number of intervals of a
/// velocity; see count_staying(). Throws StateError without a pose.
int count_staying_after(const TrackedFrame& frame, const Velocity& velocity, double n_intervals);

}  // namespace orbslam
