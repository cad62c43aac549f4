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
  /// After lengths have been multiplied by a factor.
  Velocity scaled(double factor) const;
};

/// The motion `T_cl` between two frames; nothing without a pose of either.
std::optional<Pose> motion_between(const TrackedFrame& last, const TrackedFrame& frame);

/// The velocity between two frames; nothing without a pose of either. `consecutive`: nothing either
/// unless the second is the next image, and no loop has been closed between them.
std::optional<Velocity> velocity_between(const TrackedFrame& last, const TrackedFrame& frame,
                                         bool consecutive);

/// Sets the pose of a frame by constant velocity; without one, to that of the last frame. It is
/// relative to the same keyframe as that. Throws StateError when the last frame has no pose.
void predict_pose(TrackedFrame& frame, const TrackedFrame& last, const Velocity* velocity);

/// The tangent (rotation, translation) from the pose of a frame to the predicted one; nothing
/// without a pose of either frame.
std::optional<Vector6d> innovation(const TrackedFrame& frame, const TrackedFrame& last,
                                   const Velocity& velocity);

/// How far the pose of a frame is from the predicted one.
struct PoseChange {
  double turn = 0;  ///< radians
  double move = 0;  ///< between the centres
};

/// Zero without a pose of either frame, or without a velocity.
PoseChange change_from_prediction(const TrackedFrame& frame, const TrackedFrame& last,
                                  const Velocity* velocity);

/// What tracking knows of errors of a pose that its residuals do not show.
struct HiddenErrors {
  const Velocity* velocity = nullptr;  ///< predicts the frame's pose
  const Pose* map_motion = nullptr;    ///< of the map under the last frame, since it was tracked
  double wrong_share = 0;              ///< probability that the prediction is right, not the pose
};

/// `factor` times a covariance, plus that of the motion of the map, and `wrong_share` times that of
/// the innovation.
Matrix6d stated_covariance(const Matrix6d& covariance, double factor, const TrackedFrame& frame,
                           const TrackedFrame& last, const HiddenErrors& hidden);

/// How many inliers of a frame are still in its image after so many intervals of a velocity; see
/// count_staying(). Throws StateError without a pose.
int count_staying_after(const TrackedFrame& frame, const Velocity& velocity, double n_intervals);

}  // namespace orbslam
