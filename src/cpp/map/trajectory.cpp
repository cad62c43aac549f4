// SPDX-License-Identifier: BSD-3-Clause
#include "map/trajectory.hpp"

#include "base/errors.hpp"

namespace orbslam {
namespace {

/// Grows by a quarter instead of doubling, so that long sequences waste little.
template <class Item>
void append(std::vector<Item>& items, const Item& item) {
  constexpr std::size_t kFirst = 256;
  if (items.size() == items.capacity()) items.reserve(kFirst + items.size() + items.size() / 4);
  items.push_back(item);
}

}  // namespace

void TrajectoryRecorder::check_epoch(const Map& map) const {
  if (size() == 0 || map.epoch() == epoch_) return;
  throw StateError(
      "the map was cleared since the trajectory began; rebuild() before and clear() after it");
}

void TrajectoryRecorder::record(const Map& map, const TrackedFrame& frame, bool lost) {
  RelativePose T_cr;
  KeyFrameId reference;
  {
    const auto lock = map.read_lock();
    check_epoch(map);
    if (size() == 0) epoch_ = map.epoch();
    const Anchor& anchor = frame.anchor;
    if (frame.T_cw && anchor.keyframe.valid()) {
      reference = anchor.keyframe;
      const Pose pose = *frame.T_cw * anchor.T_kw.inverse();
      const Eigen::Quaterniond& q = pose.rotation();
      const Eigen::Vector3d t = pose.translation() / anchor.scale;
      T_cr = {q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z()};
    } else if (size() > 0) {
      reference = references_.back();
      T_cr = T_cr_.back();
    }
  }
  append(timestamps_, frame.frame->timestamp);
  append(T_cr_, T_cr);
  append(references_, reference);
  append(frames_, frame.frame->id);
  append(lost_, static_cast<std::uint8_t>(lost || !reference.valid() ? 1 : 0));
}

Trajectory TrajectoryRecorder::rebuild(const Map& map) const {
  Trajectory trajectory{timestamps_, {}, lost_, frames_};
  trajectory.T_wc.reserve(size());
  const auto lock = map.read_lock();
  check_epoch(map);

  Pose T_0w;
  if (map.find(KeyFrameId(0))) T_0w = map.T_cw(KeyFrameId(0));
  KeyFrameId reference;
  ScaledPose T_rw;
  Pose T_0r;  // frames follow each other under one reference: walk its chain of parents once
  for (std::size_t i = 0; i < size(); ++i) {
    if (!references_[i].valid()) {
      trajectory.T_wc.push_back(row_major(Pose()));
      continue;
    }
    if (references_[i] != reference) {
      reference = references_[i];
      T_rw = map.scaled_pose(reference);
      T_0r = T_0w * T_rw.T_cw.inverse();
    }
    const RelativePose& r = T_cr_[i];
    const Pose T_cr(Eigen::Quaterniond(r.qw, r.qx, r.qy, r.qz),
                    T_rw.scale * Eigen::Vector3d(r.x, r.y, r.z));
    trajectory.T_wc.push_back(row_major(T_0r * T_cr.inverse()));
  }
  return trajectory;
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
