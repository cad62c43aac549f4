// SPDX-License-Identifier: BSD-3-Clause
#include "map/anchor.hpp"

#include "map/local_map.hpp"

namespace orbslam {

Anchor anchor_at(const Map& map, KeyFrameId keyframe) {
  const ScaledPose pose = map.scaled_pose(keyframe);
  return {keyframe, pose.T_cw, pose.scale, map.big_change_index(), map.map_of(keyframe)};
}

void anchor_frame(const Map& map, TrackedFrame& frame, KeyFrameId keyframe) {
  const auto lock = map.read_lock();
  frame.anchor = anchor_at(map, keyframe);
}

double move_with_anchor(const Map& map, TrackedFrame& frame) {
  if (!frame.T_cw || !frame.anchor.keyframe.valid()) return 1;
  const Anchor now = anchor_at(map, frame.anchor.keyframe);
  const double stretched = now.scale / frame.anchor.scale;
  const Pose T_fk = *frame.T_cw * frame.anchor.T_kw.inverse();
  frame.T_cw = Pose(T_fk.rotation(), stretched * T_fk.translation()) * now.T_kw;
  frame.anchor = now;
  return stretched;
}

FollowedMap follow_map(const Map& map, TrackedFrame& frame) {
  FollowedMap followed;
  const auto lock = map.read_lock();
  const std::optional<Pose> before = frame.T_cw;
  const std::uint64_t big_change = frame.anchor.big_change;
  followed.stretched = move_with_anchor(map, frame);
  if (before && frame.anchor.big_change == big_change) {
    followed.moved = *frame.T_cw * before->inverse();
  }
  refresh_associations(map, frame);
  for (const MapPointId id : frame.map_points) {
    if (const MapPoint* point = map.find(id)) followed.points.push_back(*point);
  }
  return followed;
}

}  // namespace orbslam
