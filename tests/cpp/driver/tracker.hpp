// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>

#include "driver/back_end.hpp"
#include "frame/frame.hpp"
#include "map/point_batch.hpp"

namespace orbslam::driver {

enum class Tracked { ok, lost, lost_early };

/// The tracker of tracking.py for an RGB-D camera; lost frames are looked for from the poses of
/// the keyframes that look like them.
class Tracker {
 public:
  Tracker(Map& map, const KeyFrameIndex& index, LocalMapping& mapping, Counts& counts);

  Tracked track(std::shared_ptr<Frame> image);
  /// The map that had begun beside others was dropped: lost in those that are left.
  void go_back();
  /// The next frame begins another map, whatever is in view.
  void begin_map() { begins_map_ = true; }
  void reset();
  /// The last frame with a pose, nullptr before the map begins.
  const TrackedFrame* last() const { return last_ ? &*last_ : nullptr; }

  bool localization_only() const { return localization_only_; }
  /// Also turns the camera round, so that its velocity is another.
  void use_localization(bool only) {
    localization_only_ = only;
    velocity_.reset();
  }

 private:
  bool find_pose(TrackedFrame& frame);
  bool predict(TrackedFrame& frame);
  bool relocalize(TrackedFrame& frame);
  int track_local_map(TrackedFrame& frame, const std::vector<MapPointId>& discarded);
  bool needs_keyframe(const TrackedFrame& frame) const;
  void insert(TrackedFrame& frame, std::size_t n_minimum);
  Tracked begin(TrackedFrame& frame);
  Tracked lose();
  std::size_t n_keyframes() const;

  Map& map_;
  const KeyFrameIndex& index_;
  LocalMapping& mapping_;
  Counts& counts_;
  std::optional<TrackedFrame> last_;
  std::optional<Pose> velocity_;
  KeyFrameId reference_;
  FrameId last_keyframe_ = 0;
  int n_inliers_ = 0;
  int n_lost_ = 0;
  bool lost_ = false, localization_only_ = false, begins_map_ = false;
  std::vector<MapPointId> discarded_;
};

}  // namespace orbslam::driver
