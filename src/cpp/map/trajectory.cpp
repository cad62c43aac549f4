// SPDX-License-Identifier: BSD-3-Clause
#include "map/trajectory.hpp"

#include <algorithm>

#include "base/errors.hpp"

namespace orbslam {
namespace {

/// Grows by a quarter instead of doubling, so that long sequences waste little.
template <class Item>
void insert(std::vector<Item>& items, std::size_t at, const Item& item) {
  constexpr std::size_t kFirst = 256;
  if (items.size() == items.capacity()) items.reserve(kFirst + items.size() + items.size() / 4);
  items.insert(items.begin() + static_cast<std::ptrdiff_t>(at), item);
}

}  // namespace

/// `T_cr` at a keyframe's present scale as it is at its first one.
TrajectoryRecorder::RelativePose TrajectoryRecorder::relative_pose(const Pose& T_cr, double scale) {
  const Eigen::Quaterniond& q = T_cr.rotation();
  const Eigen::Vector3d t = T_cr.translation() / scale;
  return {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()};
}

/// The way back.
Pose TrajectoryRecorder::pose_of(const RelativePose& r, double scale) {
  return {Eigen::Quaterniond(r.qw, r.qx, r.qy, r.qz), scale * Eigen::Vector3d(r.x, r.y, r.z)};
}

void TrajectoryRecorder::check_epoch(const Map& map) const {
  if (size() == 0 || map.epoch() == epoch_) return;
  throw StateError(
      "the map was cleared since the trajectory began; rebuild() before and clear() after it");
}

/// Index of the frame, or where to insert it; ids ascend.
std::size_t TrajectoryRecorder::place_of(FrameId frame) const {
  if (frames_.empty() || frames_.back() < frame) return size();
  const auto found = std::lower_bound(frames_.begin(), frames_.end(), frame);
  return static_cast<std::size_t>(found - frames_.begin());
}

void TrajectoryRecorder::record(const Map& map, const TrackedFrame& frame, bool lost) {
  const std::size_t at = place_of(frame.frame->id);
  RelativePose T_cr;
  KeyFrameId reference;
  {
    const auto lock = map.read_lock();
    check_epoch(map);
    if (size() == 0) epoch_ = map.epoch();
    const Anchor& anchor = frame.anchor;
    if (frame.T_cw && anchor.keyframe.valid()) {
      reference = anchor.keyframe;
      T_cr = relative_pose(*frame.T_cw * anchor.T_kw.inverse(), anchor.scale);
    } else if (at > 0) {
      reference = references_[at - 1];
      T_cr = T_cr_[at - 1];
    }
  }
  const auto is_lost = static_cast<std::uint8_t>(lost || !reference.valid() ? 1 : 0);
  if (at < size() && frames_[at] == frame.frame->id) {
    T_cr_[at] = T_cr;
    references_[at] = reference;
    lost_[at] = is_lost;
    return;
  }
  insert(timestamps_, at, frame.frame->timestamp);
  insert(T_cr_, at, T_cr);
  insert(references_, at, reference);
  insert(frames_, at, frame.frame->id);
  insert(lost_, at, is_lost);
}

/// Index of a frame with a pose; size() for any other.
std::size_t TrajectoryRecorder::place_with_pose(FrameId frame) const {
  const std::size_t at = place_of(frame);
  const bool known = at < size() && frames_[at] == frame;
  return known && lost_[at] == 0 && references_[at].valid() ? at : size();
}

std::optional<Pose> TrajectoryRecorder::T_cw(const Map& map, FrameId frame) const {
  check_epoch(map);
  const std::size_t at = place_with_pose(frame);
  if (at == size()) return std::nullopt;
  const ScaledPose reference = map.scaled_pose(references_[at]);
  return pose_of(T_cr_[at], reference.scale) * reference.T_cw;
}

KeyFrameId TrajectoryRecorder::reference(FrameId frame) const {
  const std::size_t at = place_with_pose(frame);
  return at == size() ? KeyFrameId() : references_[at];
}

void TrajectoryRecorder::move(const Map& map, FrameId frame, const Pose& T_cw) {
  check_epoch(map);
  const std::size_t at = place_with_pose(frame);
  if (at == size()) return;
  const ScaledPose reference = map.scaled_pose(references_[at]);
  T_cr_[at] = relative_pose(T_cw * reference.T_cw.inverse(), reference.scale);
}

/// The map of every frame. The caller holds a lock.
std::vector<MapIndex> TrajectoryRecorder::maps_of_frames(const Map& map) const {
  std::vector<MapIndex> maps(size());
  KeyFrameId reference;
  MapIndex of_reference = map.active_map();
  for (std::size_t i = size(); i-- > 0;) {
    if (references_[i].valid() && references_[i] != reference) {
      reference = references_[i];
      of_reference = map.map_of(reference);
    }
    maps[i] = of_reference;
  }
  return maps;
}

Trajectory TrajectoryRecorder::rebuild(const Map& map, MapIndex which) const {
  Trajectory trajectory;
  const auto lock = map.read_lock();
  check_epoch(map);
  const std::vector<MapIndex> maps = maps_of_frames(map);
  if (which == kNoMap) which = map.active_map();

  const KeyFrameId root = map.root(which);
  Pose T_0w;
  if (map.find(root) && !map.is_upright(which)) T_0w = map.T_cw(root);
  KeyFrameId reference;
  ScaledPose T_rw;
  Pose T_0r;  // frames follow each other under one reference: walk its chain of parents once
  for (std::size_t i = 0; i < size(); ++i) {
    if (maps[i] != which) continue;
    trajectory.timestamps.push_back(timestamps_[i]);
    trajectory.lost.push_back(lost_[i]);
    trajectory.frames.push_back(frames_[i]);
    if (!references_[i].valid()) {
      trajectory.T_wc.push_back(row_major(Pose()));
      continue;
    }
    if (references_[i] != reference) {
      reference = references_[i];
      T_rw = map.scaled_pose(reference);
      T_0r = T_0w * T_rw.T_cw.inverse();
    }
    trajectory.T_wc.push_back(row_major(T_0r * pose_of(T_cr_[i], T_rw.scale).inverse()));
  }
  return trajectory;
}

void TrajectoryRecorder::drop(const Map& map, MapIndex which) {
  std::vector<MapIndex> maps;
  {
    const auto lock = map.read_lock();
    check_epoch(map);
    maps = maps_of_frames(map);
  }
  std::size_t n_kept = 0;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    if (maps[i] == which) continue;
    timestamps_[n_kept] = timestamps_[i];
    T_cr_[n_kept] = T_cr_[i];
    references_[n_kept] = references_[i];
    frames_[n_kept] = frames_[i];
    lost_[n_kept] = lost_[i];
    ++n_kept;
  }
  truncate(n_kept);
}

void TrajectoryRecorder::truncate(std::size_t n) {
  if (n == 0) return clear();
  if (n >= size()) return;
  timestamps_.resize(n);
  T_cr_.resize(n);
  references_.resize(n);
  frames_.resize(n);
  lost_.resize(n);
}

TrajectoryRecorder::Entries TrajectoryRecorder::entries() const {
  Entries entries{timestamps_, frames_, references_, {}, lost_};
  entries.T_cr.reserve(size());
  for (const RelativePose& r : T_cr_) {
    entries.T_cr.push_back({r.qx, r.qy, r.qz, r.qw, r.x, r.y, r.z});
  }
  return entries;
}

void TrajectoryRecorder::clear() { *this = TrajectoryRecorder(); }

std::size_t TrajectoryRecorder::n_bytes() const {
  return timestamps_.capacity() * sizeof(double) + T_cr_.capacity() * sizeof(RelativePose) +
         references_.capacity() * sizeof(KeyFrameId) + frames_.capacity() * sizeof(FrameId) +
         lost_.capacity();
}

}  // namespace orbslam
