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

/// What frames saw of the map, so that their poses can follow its points. A recorded frame moves
/// with its reference keyframe; but the keyframes that come after it move each point in its own
/// way, and a keyframe that was culled is adjusted no more. Not synchronised: one thread at a time.
/// See docs/method/map.md#settled-frames.
class FrameSightings {
 public:
  /// Keeps the inliers of a frame, in place of what was kept of it before; nothing of a frame that
  /// has no pose or too few of them.
  void keep(const TrackedFrame& frame);
  void forget(FrameId frame) { frames_.erase(frame); }
  void clear() { frames_.clear(); }
  std::size_t size() const { return frames_.size(); }

  /// Estimates the poses of all but the `n_youngest` youngest frames from the points as they are
  /// now, beginning where the recorder has them, and forgets those frames. Left as they were
  /// recorded: lost frames, frames of living keyframes, which bundle adjustment has refined, those
  /// that no longer agree with half of what they saw, and those whose pose is the same within its
  /// noise. Takes the map's read lock frame by frame. Returns how many frames have a new pose.
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
