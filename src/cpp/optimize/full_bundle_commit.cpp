// SPDX-License-Identifier: BSD-3-Clause
// Commits the result of a full bundle adjustment to a map that has changed since.
#include <unordered_map>
#include <vector>

#include "map/map_rewrite.hpp"
#include "optimize/full_bundle_adjustment.hpp"

namespace orbslam {
namespace {

/// The preparation is repeated if the map changes before the write, up to a limit.
constexpr int kPreparations = 3;

/// The map's new geometry, and the version of the map that it was worked out for.
struct Preparation {
  MapRewrite rewrite;
  FullBundleCommit counts;
  std::uint64_t structure_version = 0, geometry_version = 0;

  bool fits(const Map& map) const {
    return map.structure_version() == structure_version &&
           map.geometry_version() == geometry_version;
  }
};

/// Works out new poses of all keyframes, from those of the bundle down the spanning tree.
class KeyFrameMover {
 public:
  KeyFrameMover(const Map& map, const GatheredBundle& bundle, Preparation& prepared)
      : map_(map), bundle_(bundle), prepared_(prepared) {}

  void run() {
    // The root comes first; others without a parent are not published yet.
    const KeyFrame* before = nullptr;
    map_.for_each_keyframe([&](const KeyFrame& keyframe) {
      if (keyframe.map != bundle_.map_index) return;
      if (!keyframe.parent.valid()) move_tree(keyframe, before);
      if (prepared_.rewrite.T_cw(keyframe.id) != nullptr) before = &keyframe;
    });
  }

 private:
  /// The keyframe relative to its leader (or from the bundle), and all below it, breadth first.
  void move_tree(const KeyFrame& root, const KeyFrame* leader) {
    move(root, leader);
    std::vector<const KeyFrame*> queue{&root};
    for (std::size_t i = 0; i < queue.size(); ++i) {
      const KeyFrame& parent = *queue[i];
      for (const KeyFrameId id : parent.children) {
        const KeyFrame* child = map_.find(id);
        move(*child, &parent);
        queue.push_back(child);
      }
    }
  }

  void move(const KeyFrame& keyframe, const KeyFrame* leader) {
    const auto solved = bundle_.camera_of.find(keyframe.id);
    if (solved != bundle_.camera_of.end()) {
      prepared_.rewrite.move_keyframe(keyframe.id, bundle_.problem.cameras[solved->second].T_cw);
      return;
    }
    const Pose* new_T_lw = leader != nullptr ? prepared_.rewrite.T_cw(leader->id) : nullptr;
    if (new_T_lw == nullptr) return;  // no leader
    const Pose T_cl = keyframe.T_cw * leader->T_cw.inverse();
    prepared_.rewrite.move_keyframe(keyframe.id, T_cl * *new_T_lw);
    ++prepared_.counts.n_followed_keyframes;
  }

  const Map& map_;
  const GatheredBundle& bundle_;
  Preparation& prepared_;
};

void move_points(const Map& map, const GatheredBundle& bundle, Preparation& prepared) {
  auto solved = bundle.points.begin();  // both ascend
  map.for_each_point([&](const MapPoint& point) {
    while (solved != bundle.points.end() && *solved < point.id) ++solved;
    if (solved != bundle.points.end() && *solved == point.id) {
      const auto slot = static_cast<std::size_t>(solved - bundle.points.begin());
      prepared.rewrite.move_point(point.id, bundle.problem.points[slot]);
      return;
    }
    const KeyFrame* reference = map.find(point.reference_keyframe);
    const Pose* new_T_rw = reference != nullptr ? prepared.rewrite.T_cw(reference->id) : nullptr;
    if (new_T_rw == nullptr) return;
    const Eigen::Vector3d before_camera = reference->T_cw * point.position;
    prepared.rewrite.move_point(point.id, new_T_rw->inverse() * before_camera);
    ++prepared.counts.n_followed_points;
  });
}

/// New poses and positions, without the points' directions and scale ranges. The caller holds a
/// lock.
Preparation prepare(const Map& map, const GatheredBundle& bundle) {
  Preparation prepared;
  prepared.structure_version = map.structure_version();
  prepared.geometry_version = map.geometry_version();
  KeyFrameMover(map, bundle, prepared).run();
  move_points(map, bundle, prepared);
  return prepared;
}

bool is_outdated(const GatheredBundle& bundle, const Map& map) {
  return map.epoch() != bundle.epoch || map.big_change_index() != bundle.big_changes;
}

}  // namespace

FullBundleCommit commit_full_bundle(Map& map, const GatheredBundle& bundle) {
  if (!bundle.solved) return {};
  for (int i = 1;; ++i) {
    Preparation prepared;
    {
      const auto lock = map.read_lock();
      if (is_outdated(bundle, map)) return {};
      prepared = prepare(map, bundle);
    }
    prepared.rewrite.prepare(map);
    const auto lock = map.write_lock();
    if (is_outdated(bundle, map)) return {};
    if (!prepared.fits(map)) {
      if (i < kPreparations) continue;
      prepared = prepare(map, bundle);
      prepared.rewrite.prepare_locked(map);
    }
    prepared.rewrite.apply(map);
    map.count_big_change();
    prepared.counts.committed = true;
    return prepared.counts;
  }
}

}  // namespace orbslam
