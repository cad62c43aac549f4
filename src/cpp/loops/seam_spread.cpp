// SPDX-License-Identifier: BSD-3-Clause
// Spreads the motion of an adjusted seam of two maps over the rest of the map.
#include <algorithm>
#include <atomic>
#include <utility>
#include <vector>

#include "loops/essential_graph.hpp"
#include "loops/map_merge.hpp"
#include "map/map_rewrite.hpp"
#include "optimize/pose_graph.hpp"

namespace orbslam {
namespace {

/// Keyframes and their edges, with relative poses from an earlier moment.
struct SeamGraph {
  std::uint64_t epoch = 0, big_changes = 0;
  std::vector<KeyFrameId> ids;          // ascending, living ones
  std::vector<Similarity> uncorrected;  // where each is in the map
  std::vector<std::uint8_t> in_seam;
  PoseGraph graph;
  bool upright = false;
};

void add_edges(const KeyFrame& keyframe, const std::vector<Pose>& before, SeamGraph& seam) {
  const auto at = static_cast<std::uint32_t>(vertex_of(seam.ids, keyframe.id));
  const auto add = [&](KeyFrameId other) {
    const std::ptrdiff_t found = vertex_of(seam.ids, other);
    if (found < 0) return;
    const auto j = static_cast<std::uint32_t>(found);
    seam.graph.edges.push_back({at, j, Similarity(before[j] * before[at].inverse())});
  };
  std::vector<KeyFrameId> others;
  if (keyframe.parent.valid()) others.push_back(keyframe.parent);
  for (const KeyFrameId other : keyframe.loop_edges) {
    if (other < keyframe.id) others.push_back(other);
  }
  for (const auto& [other, weight] : keyframe.weights) {
    if (other < keyframe.id && weight >= Map::kEssentialWeight) others.push_back(other);
  }
  std::sort(others.begin(), others.end());
  others.erase(std::unique(others.begin(), others.end()), others.end());
  for (const KeyFrameId other : others) add(other);
}

SeamGraph gather_seam(const Map& map, const KeyFramePoses& poses,
                      const std::vector<KeyFrameId>& members) {
  SeamGraph seam;
  std::vector<Pose> before;
  const auto lock = map.read_lock();
  seam.epoch = map.epoch();
  seam.big_changes = map.big_change_index();
  for (std::size_t k = 0; k < poses.ids.size(); ++k) {
    const KeyFrame* keyframe = map.find(poses.ids[k]);
    if (!keyframe || !keyframe->published) continue;
    seam.ids.push_back(poses.ids[k]);
    before.push_back(poses.T_cw[k]);
    seam.uncorrected.emplace_back(keyframe->T_cw);
    const bool member = std::binary_search(members.begin(), members.end(), keyframe->id);
    seam.in_seam.push_back(member ? 1 : 0);
  }
  for (const KeyFrameId id : seam.ids) add_edges(*map.find(id), before, seam);
  seam.graph.S_iw = seam.uncorrected;
  seam.graph.fixed = seam.in_seam;
  seam.upright = !seam.ids.empty() && map.is_upright(map.map_of(seam.ids.front()));
  return seam;
}

/// Whether a keyframe of the seam observes the point, so that the adjustment has moved it already.
bool is_seen_from_seam(const MapPoint& point, const SeamGraph& seam) {
  return std::any_of(point.observations.begin(), point.observations.end(), [&](const auto& seen) {
    const std::ptrdiff_t at = vertex_of(seam.ids, seen.keyframe);
    return at >= 0 && seam.in_seam[static_cast<std::size_t>(at)] != 0;
  });
}

/// The last keyframe and point of a map that were processed; invalid ids for an empty map.
struct LookedAt {
  KeyFrameId keyframe;
  MapPointId point;
};

/// New places of the keyframes and points that are younger than those processed before.
MapRewrite rewrite_of(const Map& map, const SeamGraph& seam, LookedAt& looked_at) {
  const LookedAt before = looked_at;
  std::vector<Similarity> world;  // per vertex: from the world before to the one after
  for (std::size_t k = 0; k < seam.ids.size(); ++k) {
    world.push_back(seam.graph.S_iw[k].inverse() * seam.uncorrected[k]);
  }
  const MapIndex which = map.map_of(seam.ids.front());
  MapRewrite rewrite;
  map.for_each_keyframe([&](const KeyFrame& keyframe) {
    if (before.keyframe.valid() && keyframe.id <= before.keyframe) return;
    looked_at.keyframe = keyframe.id;
    if (keyframe.map != which) return;
    const std::size_t vertex = vertex_before(seam.ids, keyframe.id);
    if (seam.in_seam[vertex] != 0 && seam.ids[vertex] == keyframe.id) return;
    const Similarity S_cw = Similarity(keyframe.T_cw) * world[vertex].inverse();
    rewrite.move_keyframe(keyframe.id, S_cw.pose(), 1 / S_cw.scale());
  });
  if (before.keyframe.valid() && rewrite.n_keyframes() == 0) return rewrite;
  map.for_each_point([&](const MapPoint& point) {
    if (before.point.valid() && point.id <= before.point) return;
    looked_at.point = point.id;
    if (!map.is_in(point, which)) return;
    const std::size_t vertex = vertex_before(seam.ids, point.reference_keyframe);
    const bool stays = seam.in_seam[vertex] != 0 || is_seen_from_seam(point, seam);
    rewrite.move_point(point.id, stays ? point.position : world[vertex] * point.position);
  });
  return rewrite;
}

}  // namespace

bool spread_from_seam(Map& map, const KeyFramePoses& before, const std::vector<KeyFrameId>& members,
                      bool fix_scale, const std::atomic<bool>* abort) {
  SeamGraph seam = gather_seam(map, before, members);
  const auto n_fixed = std::count(seam.in_seam.begin(), seam.in_seam.end(), 1);
  if (n_fixed == 0 || n_fixed == static_cast<std::ptrdiff_t>(seam.ids.size())) return false;
  PoseGraphOptions options;
  options.fix_scale = fix_scale;
  options.upright = seam.upright;
  const PoseGraphSummary summary = optimize_pose_graph(seam.graph, options, abort);
  if (summary.aborted || summary.iterations == 0) return false;
  MapRewrite rewrite;
  LookedAt looked_at;
  {
    const auto lock = map.read_lock();
    if (map.epoch() != seam.epoch || map.big_change_index() != seam.big_changes) return false;
    rewrite = rewrite_of(map, seam, looked_at);
  }
  rewrite.prepare(map);
  const auto lock = map.write_lock();
  if (map.epoch() != seam.epoch || map.big_change_index() != seam.big_changes) return false;
  // The tracker may just have inserted keyframes, with points of their own: they move too.
  const MapRewrite late = rewrite_of(map, seam, looked_at);
  rewrite.apply(map);
  late.apply(map);
  map.count_big_change();
  return true;
}

}  // namespace orbslam
