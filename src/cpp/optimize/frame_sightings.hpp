// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "frame/frame.hpp"
#include "map/map.hpp"
#include "map/trajectory.hpp"

namespace orbslam {

/// Observations of past frames, with which their poses are estimated again. A recorded frame moves
/// with its reference keyframe. But later keyframes move each point differently, and a culled
/// keyframe is no longer adjusted. Not synchronised: one thread at a time. See
/// docs/method/map.md#settled-frames.
class FrameSightings {
 public:
  /// Stores the inliers of a frame, and replaces those stored before. Stores nothing for a frame
  /// without a pose or with too few inliers.
  void keep(const TrackedFrame& frame);
  void forget(FrameId frame) { frames_.erase(frame); }
  void clear() { frames_.clear(); }
  std::size_t size() const { return frames_.size(); }

  /// Estimates the poses of all but the `n_youngest` youngest frames from the present points,
  /// starting at the recorded poses, and forgets those frames. Four kinds of frames keep their
  /// recorded pose: lost frames, frames of living keyframes (refined by bundle adjustment), frames
  /// that agree with less than half of their observations, and frames whose pose is the same within
  /// its noise. Takes the map's read lock frame by frame. Returns how many frames have a new pose.
  int settle(const Map& map, TrajectoryRecorder& recorder, std::size_t n_youngest);

 private:
  struct Sighting {
    MapPointId point;
    float u, v, right_u, inverse_sigma2, right_factor;
    bool has_depth;
  };
  struct Sightings {
    std::shared_ptr<const Camera> camera;
    std::vector<Sighting> seen;
  };
  static std::optional<Pose> settled_pose(const Map& map, const TrajectoryRecorder& recorder,
                                          FrameId frame, const Sightings& sightings);

  std::map<FrameId, Sightings> frames_;  ///< by id, the oldest first
};

}  // namespace orbslam
