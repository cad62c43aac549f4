// SPDX-License-Identifier: BSD-3-Clause
#include "loops/seam.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "matching/by_sim3.hpp"

namespace orbslam {
namespace {

bool is_published(const Map& map, KeyFrameId id) {
  const KeyFrame* keyframe = map.find(id);
  return keyframe && keyframe->published;
}

/// `current` and its neighbours by what it observes now. The caller holds a lock.
std::vector<KeyFrameId> group_of(const Map& map, KeyFrameId current) {
  const FusionDraft alone(map, {current}, {});
  std::vector<KeyFrameId> group{current};
  for (const KeyFrameId neighbour : neighbours_by(alone.shared_points().front())) {
    if (is_published(map, neighbour)) group.push_back(neighbour);
  }
  return group;
}

/// The living points on the far side. The caller holds a lock.
std::vector<MapPointId> far_side(const Map& map, const Loop& loop) {
  std::vector<MapPointId> far;
  far.reserve(loop.loop_points.size() + loop.matches.size());
  for (const MapPointId id : loop.loop_points) far.push_back(map.resolve(id));
  for (const MapPointId id : loop.matches) far.push_back(map.resolve(id));
  return far;
}

void draft_fusions(const std::vector<MapPointId>& matches, const CorrectedGroup& group,
                   FusionDraft& draft) {
  for (std::size_t i = 0; i < matches.size(); ++i) {
    draft.fuse(0, static_cast<std::uint32_t>(i), matches[i]);
  }
  for (std::size_t k = 0; k < group.keyframes.size(); ++k) {
    const auto found = find_loop_fusions(draft.frame(k), group.corrected[k], draft.far_points());
    for (const PointSighting& seen : found) draft.fuse(k, seen.keypoint, seen.point);
  }
}

void find_links(const std::vector<SharedPoints>& before, CorrectedGroup& group) {
  std::vector<KeyFrameId> members = group.keyframes;
  std::sort(members.begin(), members.end());
  for (std::size_t k = 0; k < group.keyframes.size(); ++k) {
    std::vector<KeyFrameId> old = neighbours_by(before[k]);
    std::sort(old.begin(), old.end());
    for (const auto& entry : group.shared[k]) {
      const KeyFrameId other = entry.first;
      if (std::binary_search(old.begin(), old.end(), other)) continue;
      if (std::binary_search(members.begin(), members.end(), other)) continue;
      group.links.emplace_back(group.keyframes[k], other);
    }
  }
}

}  // namespace

std::optional<Seam> draft_seam(const Map& map, const Loop& loop, bool fix_scale) {
  std::optional<Seam> seam;
  std::vector<MapPointId> matches;
  {
    const auto lock = map.read_lock();
    if (!is_published(map, loop.current) || !is_published(map, loop.matched)) return seam;
    if (loop.matches.size() != map.find(loop.current)->map_points.size()) {
      throw std::invalid_argument(
          "plan_loop_correction: the loop must have one match, or an invalid id, per keypoint of "
          "its current keyframe");
    }
    CorrectedGroup group;
    group.keyframes = group_of(map, loop.current);
    FusionDraft draft(map, group.keyframes, far_side(map, loop));
    seam.emplace(Seam{map.epoch(), map.map_of(loop.current), map.map_of(loop.matched),
                      std::move(group), std::move(draft)});
    for (const MapPointId id : loop.matches) matches.push_back(map.resolve(id));
  }
  CorrectedGroup& group = seam->group;
  FusionDraft& draft = seam->draft;
  const Similarity S_cw = fix_scale ? Similarity(loop.S_cw.pose()) : loop.S_cw;
  const Pose T_wc = draft.T_cw(0).inverse();
  for (std::size_t k = 0; k < group.keyframes.size(); ++k) {
    group.corrected.push_back(k == 0 ? S_cw : Similarity(draft.T_cw(k) * T_wc) * S_cw);
  }
  const std::vector<SharedPoints> before = draft.shared_points();
  draft_fusions(matches, group, draft);
  group.shared = draft.shared_points();
  find_links(before, group);
  return seam;
}

}  // namespace orbslam
