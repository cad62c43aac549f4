// SPDX-License-Identifier: BSD-3-Clause
// The changes that a correction makes to the map. What can be worked out before the write section
// is worked out under a read lock.
#include <algorithm>

#include "loops/essential_graph.hpp"
#include "loops/loop_correction.hpp"
#include "map/map_rewrite.hpp"

namespace orbslam {
namespace {

/// How the world moves at each vertex.
class Movement {
 public:
  explicit Movement(const LoopCorrection& correction) : correction_(correction) {
    world_.reserve(correction.keyframes.size());
    for (std::size_t k = 0; k < correction.keyframes.size(); ++k) {
      world_.push_back(correction.graph.S_iw[k].inverse() * correction.uncorrected[k]);
    }
  }

  void move_keyframe(const KeyFrame& keyframe, MapRewrite& rewrite) const {
    const std::ptrdiff_t vertex = vertex_of(correction_.keyframes, keyframe.id);
    const Similarity S_cw = vertex >= 0
                                ? correction_.graph.S_iw[static_cast<std::size_t>(vertex)]
                                : Similarity(keyframe.T_cw) * world_at(keyframe.id).inverse();
    rewrite.move_keyframe(keyframe.id, S_cw.pose(), 1 / S_cw.scale());
  }
  void move_point(const MapPoint& point, std::uint32_t vertex, MapRewrite& rewrite) const {
    rewrite.move_point(point.id, world_[vertex] * point.position);
  }
  /// A point that was not planned for.
  void move_point(const MapPoint& point, MapRewrite& rewrite) const {
    rewrite.move_point(point.id, world_at(point.reference_keyframe) * point.position);
  }

 private:
  const Similarity& world_at(KeyFrameId id) const {
    return world_[vertex_before(correction_.keyframes, id)];
  }

  const LoopCorrection& correction_;
  std::vector<Similarity> world_;  // per vertex: from the old world to the new one
};

bool is_applicable(const Map& map, const LoopCorrection& correction) {
  return !correction.keyframes.empty() && map.epoch() == correction.epoch &&
         map.find(correction.loop.current) && map.find(correction.loop.matched);
}

/// Everything in the map at this moment. The caller holds a lock. Returns the last keyframe.
KeyFrameId prepare(const Map& map, const LoopCorrection& correction, const Movement& movement,
                   MapRewrite& rewrite) {
  KeyFrameId last;
  map.for_each_keyframe([&](const KeyFrame& keyframe) {
    movement.move_keyframe(keyframe, rewrite);
    last = keyframe.id;
  });
  auto planned = correction.carried.begin();
  map.for_each_point([&](const MapPoint& point) {
    while (planned != correction.carried.end() && planned->first < point.id) ++planned;
    if (planned != correction.carried.end() && planned->first == point.id) {
      movement.move_point(point, planned->second, rewrite);
    } else {
      movement.move_point(point, rewrite);
    }
  });
  rewrite.prepare(map);
  return last;
}

/// Keyframes that the tracker inserted after the preparation, with the points it made of them.
MapRewrite newcomers(const Map& map, KeyFrameId last, const Movement& movement) {
  MapRewrite rewrite;
  map.for_each_keyframe([&](const KeyFrame& keyframe) {
    if (keyframe.id <= last) return;
    movement.move_keyframe(keyframe, rewrite);
    for (const MapPointId id : keyframe.map_points) {
      const MapPoint* point = map.find(id);
      if (point && point->reference_keyframe == keyframe.id) movement.move_point(*point, rewrite);
    }
  });
  return rewrite;
}

/// Returns the number of changes. Points that gained an observation are appended to `added`.
int fuse(Map& map, const LoopCorrection& correction, std::vector<MapPointId>& added) {
  int n_fused = 0;
  for (const LoopCorrection::Fusion& fusion : correction.fusions) {
    const MapPointId survivor = map.resolve(fusion.point);
    const MapPoint* point = map.find(survivor);
    if (!point) continue;
    if (fusion.replaced.valid()) {
      const MapPointId replaced = map.resolve(fusion.replaced);
      if (!replaced.valid() || replaced == survivor) continue;
      map.replace_point(replaced, survivor);
    } else {
      const KeyFrame* keyframe = map.find(fusion.keyframe);
      if (!keyframe || map.find(keyframe->map_points[fusion.keypoint]) ||
          point->observation_of(fusion.keyframe)) {
        continue;
      }
      map.add_observation(survivor, fusion.keyframe, fusion.keypoint);
      added.push_back(survivor);
    }
    ++n_fused;
  }
  return n_fused;
}

void describe_movement(const LoopCorrection& correction, const Pose& before, const Pose& after,
                       LoopCorrectionResult& result) {
  const std::ptrdiff_t vertex = vertex_of(correction.keyframes, correction.loop.current);
  result.translation = (after.center() - before.center()).norm();
  result.rotation = before.rotation().angularDistance(after.rotation());
  result.scale = 1 / correction.graph.S_iw[static_cast<std::size_t>(vertex)].scale();
}

}  // namespace

LoopCorrectionResult apply_loop_correction(Map& map, const LoopCorrection& correction) {
  LoopCorrectionResult result;
  const Movement movement(correction);
  MapRewrite rewrite;
  KeyFrameId last;
  Pose before;
  {
    const auto lock = map.read_lock();
    if (!is_applicable(map, correction)) return result;
    before = map.T_cw(correction.loop.current);
    last = prepare(map, correction, movement, rewrite);
  }
  const auto lock = map.write_lock();
  if (!is_applicable(map, correction)) return result;
  MapRewrite late = newcomers(map, last, movement);
  std::vector<MapPointId> added;
  result.n_fused = fuse(map, correction, added);
  rewrite.apply(map);
  late.apply(map);
  std::sort(added.begin(), added.end());
  added.erase(std::unique(added.begin(), added.end()), added.end());
  for (const MapPointId id : added) map.update_descriptor(id);
  for (const KeyFrameId id : correction.group) {
    if (map.find(id)) map.update_connections(id);
  }
  map.add_loop_edge(correction.loop.matched, correction.loop.current);
  map.count_big_change();
  describe_movement(correction, before, map.T_cw(correction.loop.current), result);
  result.applied = true;
  return result;
}

}  // namespace orbslam
