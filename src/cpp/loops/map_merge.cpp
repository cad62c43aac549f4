// SPDX-License-Identifier: BSD-3-Clause
#include "loops/map_merge.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "loops/seam.hpp"
#include "loops/upright.hpp"
#include "map/map_rewrite.hpp"

namespace orbslam {
namespace {

bool can_be_joined(const Map& map, const MapMerge& merge) {
  const KeyFrame* current = map.find(merge.loop.current);
  const KeyFrame* matched = map.find(merge.loop.matched);
  if (merge.kept == kNoMap || map.epoch() != merge.epoch || !current || !matched) return false;
  return std::minmax(current->map, matched->map) == std::minmax(merge.kept, merge.moved);
}

/// Moves a whole map by one similarity: prepared under a read lock, written in a write section.
class MovedMap {
 public:
  /// Takes the read lock, for a short while at a time.
  MovedMap(const Map& map, const MapMerge& merge) : merge_(merge) {
    auto lock = map.read_lock();
    if (!can_be_joined(map, merge)) return;
    map.for_each_keyframe([&](const KeyFrame& keyframe) {
      if (keyframe.map == merge_.moved) move(keyframe, rewrite_);
      last_keyframe_ = keyframe.id;
    });
    map.for_each_point([&](const MapPoint& point) {
      if (map.is_in(point, merge_.moved)) move(point, rewrite_);
      last_point_ = point.id;
    });
    lock.unlock();
    rewrite_.prepare(map);
  }

  /// The caller holds the write lock. Keyframes may have been added since the preparation, with
  /// points of their own: they move too.
  void apply(Map& map, MapMergeResult& result) const {
    MapRewrite late;
    map.for_each_keyframe([&](const KeyFrame& keyframe) {
      if (keyframe.id > last_keyframe_ && keyframe.map == merge_.moved) move(keyframe, late);
    });
    if (late.n_keyframes() > 0) {
      map.for_each_point([&](const MapPoint& point) {
        if (point.id > last_point_ && map.is_in(point, merge_.moved)) move(point, late);
      });
    }
    rewrite_.apply(map);
    late.apply(map);
    result.n_moved_keyframes = static_cast<int>(rewrite_.n_keyframes() + late.n_keyframes());
    result.n_moved_points = static_cast<int>(rewrite_.n_points() + late.n_points());
  }

 private:
  void move(const KeyFrame& keyframe, MapRewrite& rewrite) const {
    const Similarity S_cw = Similarity(keyframe.T_cw) * merge_.S_km.inverse();
    rewrite.move_keyframe(keyframe.id, S_cw.pose(), 1 / S_cw.scale());
  }
  void move(const MapPoint& point, MapRewrite& rewrite) const {
    rewrite.move_point(point.id, merge_.S_km * point.position);
  }

  const MapMerge& merge_;
  MapRewrite rewrite_;
  KeyFrameId last_keyframe_;
  MapPointId last_point_;
};

void join(Map& map, const MapMerge& merge) {
  const KeyFrameId current = merge.loop.current, matched = merge.loop.matched;
  const bool current_moves = map.find(current)->map == merge.moved;
  map.join_maps(current_moves ? current : matched, current_moves ? matched : current);
}

/// Calls visit(first, last) for short runs of `count` elements. Each run has its own write section,
/// so a reader waits for one run at most. Ends early when the map was cleared.
template <typename Visit>
void in_short_sections(Map& map, std::uint64_t epoch, std::size_t count, std::size_t length,
                       Visit&& visit) {
  for (std::size_t first = 0; first < count; first += length) {
    const auto lock = map.write_lock();
    if (map.epoch() != epoch) return;
    visit(first, std::min(first + length, count));
  }
}

/// Fuses the points that both sides share. Returns the number of fused points.
int fuse_seam(Map& map, const MapMerge& merge) {
  constexpr std::size_t kPoints = 256, kKeyframes = 4;
  int n_fused = 0;
  std::vector<MapPointId> added;
  in_short_sections(map, merge.epoch, merge.fusions.size(), kPoints,
                    [&](std::size_t first, std::size_t last) {
                      n_fused += carry_out(merge.fusions, first, last, map, added);
                    });
  std::sort(added.begin(), added.end());
  added.erase(std::unique(added.begin(), added.end()), added.end());
  in_short_sections(map, merge.epoch, added.size(), kPoints,
                    [&](std::size_t first, std::size_t last) {
                      for (std::size_t i = first; i < last; ++i) map.update_point(added[i]);
                    });
  in_short_sections(map, merge.epoch, merge.group.size(), kKeyframes,
                    [&](std::size_t first, std::size_t last) {
                      for (std::size_t i = first; i < last; ++i) {
                        if (map.find(merge.group[i])) map.update_connections(merge.group[i]);
                      }
                    });
  return n_fused;
}

}  // namespace

MapMerge plan_map_merge(const Map& map, const Loop& loop, bool fix_scale) {
  MapMerge merge;
  merge.loop = loop;
  std::optional<Seam> seam = draft_seam(map, loop, fix_scale);
  if (!seam || seam->near_map == seam->far_map) return merge;
  Similarity S_cf = fix_scale ? Similarity(loop.S_cw.pose()) : loop.S_cw;
  const bool near_upright = is_upright(map, seam->near_map);
  const bool far_upright = is_upright(map, seam->far_map);
  if (near_upright && far_upright) {
    if (const auto turn = upright_correction(seam->draft.T_cw(0), S_cf)) S_cf = S_cf * *turn;
  }
  const Similarity S_fn = S_cf.inverse() * Similarity(seam->draft.T_cw(0));  // near to far world
  merge.epoch = seam->epoch;
  merge.kept = std::min(seam->near_map, seam->far_map);
  merge.moved = std::max(seam->near_map, seam->far_map);
  if (near_upright != far_upright) {
    merge.kept = near_upright ? seam->near_map : seam->far_map;
    merge.moved = near_upright ? seam->far_map : seam->near_map;
  }
  merge.S_km = seam->near_map == merge.moved ? S_fn : S_fn.inverse();
  merge.fusions = seam->draft.take_fusions();
  merge.group = seam->group.keyframes;
  return merge;
}

MapMergeResult apply_map_merge(Map& map, const MapMerge& merge) {
  MapMergeResult result;
  const MovedMap moved(map, merge);
  {
    const auto lock = map.write_lock();
    if (!can_be_joined(map, merge)) return result;
    moved.apply(map, result);
    join(map, merge);
    map.add_loop_edge(merge.loop.matched, merge.loop.current);
    map.count_big_change();
  }
  result.n_fused = fuse_seam(map, merge);
  result.applied = true;
  result.kept = merge.kept;
  result.moved = merge.moved;
  result.scale = merge.S_km.scale();
  return result;
}

std::vector<KeyFrameId> keyframes_of_seam(const Map& map, KeyFrameId current) {
  std::vector<KeyFrameId> seam;
  const auto lock = map.read_lock();
  if (const KeyFrame* keyframe = map.find(current)) {
    seam = keyframe->neighbours;
    seam.push_back(current);
  }
  std::sort(seam.begin(), seam.end());
  return seam;
}

KeyFramePoses poses_of_map(const Map& map, MapIndex which) {
  KeyFramePoses poses;
  const auto lock = map.read_lock();
  map.for_each_keyframe([&](const KeyFrame& keyframe) {
    if (keyframe.map != which || !keyframe.published) return;
    poses.ids.push_back(keyframe.id);
    poses.T_cw.push_back(keyframe.T_cw);
  });
  return poses;
}

}  // namespace orbslam
