// SPDX-License-Identifier: BSD-3-Clause
// The changes that a correction makes to the map.
#include <algorithm>

#include "loops/essential_graph.hpp"
#include "loops/loop_correction.hpp"
#include "loops/prepared_correction.hpp"

namespace orbslam {
namespace {

bool is_applicable(const Map& map, const LoopCorrection& correction) {
  return !correction.keyframes.empty() && map.epoch() == correction.epoch &&
         map.find(correction.loop.current) && map.find(correction.loop.matched) &&
         map.find(correction.loop.current)->map == correction.map;
}

}  // namespace

PreparedCorrection::PreparedCorrection(const Map& map, const LoopCorrection& correction)
    : correction_(correction) {
  auto lock = map.read_lock();
  if (!is_applicable(map, correction)) return;
  world_.reserve(correction.keyframes.size());
  for (std::size_t k = 0; k < correction.keyframes.size(); ++k) {
    world_.push_back(correction.graph.S_iw[k].inverse() * correction.uncorrected[k]);
  }
  map.for_each_keyframe([&](const KeyFrame& keyframe) {
    if (keyframe.map == correction.map) move_keyframe(keyframe, rewrite_);
    last_ = keyframe.id;
  });
  auto planned = correction.carried.begin();  // both ascend
  map.for_each_point([&](const MapPoint& point) {
    if (!map.is_in(point, correction.map)) return;
    while (planned != correction.carried.end() && planned->first < point.id) ++planned;
    const bool was_planned = planned != correction.carried.end() && planned->first == point.id;
    move_point(point, was_planned ? world_[planned->second] : world_at(point.reference_keyframe),
               rewrite_);
  });
  lock.unlock();
  rewrite_.prepare(map);
}

const Similarity& PreparedCorrection::world_at(KeyFrameId id) const {
  return world_[vertex_before(correction_.keyframes, id)];
}

void PreparedCorrection::move_keyframe(const KeyFrame& keyframe, MapRewrite& rewrite) const {
  const std::ptrdiff_t vertex = vertex_of(correction_.keyframes, keyframe.id);
  const Similarity S_cw = vertex >= 0 ? correction_.graph.S_iw[static_cast<std::size_t>(vertex)]
                                      : Similarity(keyframe.T_cw) * world_at(keyframe.id).inverse();
  rewrite.move_keyframe(keyframe.id, S_cw.pose(), 1 / S_cw.scale());
}

void PreparedCorrection::move_point(const MapPoint& point, const Similarity& world,
                                    MapRewrite& rewrite) {
  rewrite.move_point(point.id, world * point.position);
}

MapRewrite PreparedCorrection::newcomers(const Map& map) const {
  MapRewrite rewrite;
  map.for_each_keyframe([&](const KeyFrame& keyframe) {
    if (keyframe.id <= last_ || keyframe.map != correction_.map) return;
    move_keyframe(keyframe, rewrite);
    for (const MapPointId id : keyframe.map_points) {
      const MapPoint* point = map.find(id);
      if (!point || point->reference_keyframe != keyframe.id) continue;
      move_point(*point, world_at(keyframe.id), rewrite);
    }
  });
  return rewrite;
}

LoopCorrectionResult PreparedCorrection::commit(Map& map) const {
  LoopCorrectionResult result;
  if (world_.empty() || !is_applicable(map, correction_)) return result;
  const KeyFrameId current = correction_.loop.current;
  const ScaledPose before = map.scaled_pose(current);
  const MapRewrite late = newcomers(map);
  std::vector<MapPointId> added;
  result.n_fused = carry_out(correction_.fusions, 0, correction_.fusions.size(), map, added);
  rewrite_.apply(map);
  late.apply(map);
  std::sort(added.begin(), added.end());
  added.erase(std::unique(added.begin(), added.end()), added.end());
  for (const MapPointId id : added) map.update_descriptor(id);
  for (const KeyFrameId id : correction_.group) {
    if (map.find(id)) map.update_connections(id);
  }
  map.add_loop_edge(correction_.loop.matched, current);
  map.count_big_change();

  const ScaledPose after = map.scaled_pose(current);
  result.applied = true;
  result.translation = (after.T_cw.center() - before.T_cw.center()).norm();
  result.rotation = before.T_cw.rotation().angularDistance(after.T_cw.rotation());
  result.scale = after.scale / before.scale;
  return result;
}

LoopCorrectionResult apply_loop_correction(Map& map, const LoopCorrection& correction) {
  const PreparedCorrection prepared(map, correction);
  const auto lock = map.write_lock();
  return prepared.commit(map);
}

}  // namespace orbslam
