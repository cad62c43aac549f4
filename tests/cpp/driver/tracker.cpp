// SPDX-License-Identifier: BSD-3-Clause
#include "driver/tracker.hpp"

#include <limits>

#include "map/anchor.hpp"
#include "map/keyframe_insertion.hpp"
#include "map/local_map.hpp"
#include "map/sightings.hpp"
#include "matching/by_projection.hpp"
#include "matching/by_words.hpp"
#include "optimize/pose_optimization.hpp"
#include "places/place_recognition.hpp"

namespace orbslam::driver {
namespace {

constexpr int kFewestInliers = 15;
constexpr std::size_t kSmallMap = 5;
constexpr int kPatience = 8;  // lost frames in a row, after which another map begins

}  // namespace

Tracker::Tracker(Map& map, const KeyFrameIndex& index, LocalMapping& mapping, Counts& counts)
    : map_(map), index_(index), mapping_(mapping), counts_(counts) {}

void Tracker::reset() {
  last_.reset();
  velocity_.reset();
  reference_ = KeyFrameId();
  last_keyframe_ = 0;
  n_lost_ = 0;
  lost_ = begins_map_ = false;
}

void Tracker::go_back() {
  reset();
  lost_ = true;
}

Tracked Tracker::begin(TrackedFrame& frame) {
  if (frame.frame->size() < 100) return Tracked::lost;
  {
    const auto lock = map_.write_lock();
    const MapIndex before = map_.active_map();
    if (map_.begin_map() != before) ++counts_.maps_begun;
  }
  frame = TrackedFrame(frame.frame);
  frame.T_cw = Pose();
  insert(frame, std::numeric_limits<std::size_t>::max());
  velocity_.reset();
  n_lost_ = 0;
  lost_ = begins_map_ = false;
  last_ = std::move(frame);
  return Tracked::ok;
}

std::size_t Tracker::n_keyframes() const {
  const auto lock = map_.read_lock();
  return map_.n_keyframes_of(map_.active_map());
}

Tracked Tracker::track(std::shared_ptr<Frame> image) {
  ++counts_.frames;
  TrackedFrame frame(std::move(image));
  if (!last_ && !lost_) return begin(frame);
  if (begins_map_ && !localization_only_ && n_keyframes() > kSmallMap) {
    const Tracked begun = begin(frame);
    if (begun == Tracked::ok) return begun;
  }
  const std::uint64_t moves = map_.big_change_index();
  bool found = find_pose(frame);
  if (!found && map_.big_change_index() != moves) {
    frame.clear_associations();
    found = find_pose(frame);
  }
  if (!found) {
    if (n_lost_ >= kPatience && !localization_only_ && begin(frame) == Tracked::ok) {
      return Tracked::ok;
    }
    return lose();
  }
  if (lost_) {
    ++counts_.relocalized;
    const auto lock = map_.write_lock();
    const MapIndex found_in = map_.map_of(reference_);
    if (found_in != map_.active_map()) ++counts_.maps_switched;
    map_.activate_map(found_in);
  }
  n_lost_ = 0;

  const bool consecutive =
      !lost_ && last_ && last_->T_cw && frame.anchor.big_change == last_->anchor.big_change;
  velocity_.reset();
  if (consecutive) velocity_ = *frame.T_cw * last_->T_cw->inverse();
  lost_ = false;
  if (localization_only_) {
    ++counts_.localized;
  } else if (needs_keyframe(frame)) {
    insert(frame, 100);
  }
  frame.discard_outliers();
  last_ = std::move(frame);
  return Tracked::ok;
}

Tracked Tracker::lose() {
  ++counts_.lost;
  ++n_lost_;
  lost_ = true;
  velocity_.reset();
  return n_keyframes() <= kSmallMap ? Tracked::lost_early : Tracked::lost;
}

bool Tracker::find_pose(TrackedFrame& frame) {
  if (lost_ ? !relocalize(frame) : !predict(frame)) return false;
  n_inliers_ = track_local_map(frame, discarded_);
  return n_inliers_ >= kFewestInliers + 5;
}

bool Tracker::predict(TrackedFrame& frame) {
  const PointBatch points = follow_map(map_, *last_).points;
  {
    const auto lock = map_.read_lock();
    reference_ = map_.living(reference_);
  }
  frame.T_cw = velocity_ ? *velocity_ * *last_->T_cw : *last_->T_cw;
  frame.anchor = last_->anchor;
  int n_matches = match_last_frame(frame, *last_, points, 20, true);
  if (n_matches < 20) {
    frame.clear_associations();
    n_matches = match_last_frame(frame, *last_, points, 40, true);
  }
  if (n_matches < 20) {
    frame.clear_associations();
    frame.T_cw = last_->T_cw;
    n_matches = match_keyframe_by_words(map_, reference_, frame, 0.7F);
  }
  if (n_matches < kFewestInliers) return false;
  const PoseEstimate estimate = optimize_pose(frame);
  discarded_ = frame.discard_outliers();
  return estimate.n_inliers >= 10;
}

bool Tracker::relocalize(TrackedFrame& frame) {
  for (const PlaceCandidate& place : find_relocalization_candidates(index_, map_, *frame.frame)) {
    frame.clear_associations();
    if (match_keyframe_by_words(map_, place.keyframe, frame, 0.75F) < kFewestInliers) continue;
    {
      const auto lock = map_.read_lock();
      const KeyFrame* keyframe = map_.find(place.keyframe);
      if (!keyframe) continue;
      frame.T_cw = keyframe->T_cw;
    }
    anchor_frame(map_, frame, place.keyframe);
    const PoseEstimate estimate = optimize_pose(frame);
    discarded_ = frame.discard_outliers();
    if (estimate.n_inliers >= kFewestInliers) {
      reference_ = place.keyframe;
      return true;
    }
  }
  frame.clear_associations();
  return false;
}

int Tracker::track_local_map(TrackedFrame& frame, const std::vector<MapPointId>& discarded) {
  const LocalMap local = select_local_map(map_, frame);
  if (local.reference_keyframe.valid()) reference_ = local.reference_keyframe;
  const LocalMapMatches matches = match_local_map(frame, local.points, discarded, 3);
  const PoseEstimate estimate = optimize_pose(frame);
  count_sightings(map_, frame, matches.visible);
  return estimate.n_inliers;
}

bool Tracker::needs_keyframe(const TrackedFrame& frame) const {
  if (mapping_.worker.pausing()) return false;
  const int n_reference = count_tracked_points(map_, reference_, 3);
  const bool weak = n_inliers_ < 0.75 * n_reference;
  const bool idle = mapping_.worker.idle();
  // The camera turns fast: a keyframe is out of view after a dozen frames.
  const FrameId since = frame.frame->id - last_keyframe_;
  if (!weak && since < (idle ? 3 : 5)) return false;
  if (idle) return true;
  mapping_.worker.interrupt();
  return mapping_.worker.n_waiting() < 3;
}

void Tracker::insert(TrackedFrame& frame, std::size_t n_minimum) {
  reference_ = insert_keyframe(map_, frame, true, n_minimum);
  last_keyframe_ = frame.frame->id;
  mapping_.add_inertial(reference_, frame.frame->timestamp);
  mapping_.insert_keyframe(reference_);
}

}  // namespace orbslam::driver
