// SPDX-License-Identifier: BSD-3-Clause
// Gathers the bundle of a full bundle adjustment.
#include <algorithm>
#include <numeric>
#include <vector>

#include "optimize/full_bundle_adjustment.hpp"

namespace orbslam {
namespace {

/// Disjoint sets of numbers; the smallest number of a set stands for it.
class Sets {
 public:
  explicit Sets(std::size_t n) : above_(n) { std::iota(above_.begin(), above_.end(), 0U); }

  std::uint32_t find(std::uint32_t i) {
    while (above_[i] != i) i = above_[i] = above_[above_[i]];
    return i;
  }
  void join(std::uint32_t i, std::uint32_t j) {
    i = find(i);
    j = find(j);
    above_[std::max(i, j)] = std::min(i, j);
  }

 private:
  std::vector<std::uint32_t> above_;
};

/// Per camera whether it belongs to the largest part that is tied together by points (ties: the
/// part with the lowest camera).
std::vector<bool> largest_part(const BundleProblem& problem) {
  Sets parts(problem.cameras.size());
  const auto& observations = problem.observations;
  for (std::size_t i = 1; i < observations.size(); ++i) {  // those of a point follow each other
    if (observations[i].point != observations[i - 1].point) continue;
    parts.join(observations[i].camera, observations[i - 1].camera);
  }
  const auto n = static_cast<std::uint32_t>(problem.cameras.size());
  std::vector<int> size(n, 0);
  for (std::uint32_t i = 0; i < n; ++i) ++size[parts.find(i)];
  const auto largest =
      static_cast<std::uint32_t>(std::max_element(size.begin(), size.end()) - size.begin());
  std::vector<bool> chosen(n);
  for (std::uint32_t i = 0; i < n; ++i) chosen[i] = parts.find(i) == largest;
  return chosen;
}

/// Removes the other cameras, their observations, and the points without remaining observations.
GatheredBundle reduce(const GatheredBundle& all, const std::vector<bool>& cameras, const Map& map) {
  GatheredBundle kept(map);
  kept.epoch = all.epoch;
  kept.big_changes = all.big_changes;
  kept.map_index = all.map_index;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (!cameras[i]) continue;
    kept.camera_of.emplace(all.keyframes[i], static_cast<std::uint32_t>(kept.keyframes.size()));
    kept.keyframes.push_back(all.keyframes[i]);
    kept.problem.cameras.push_back(all.problem.cameras[i]);
  }
  constexpr std::uint32_t kNobody = ~std::uint32_t{0};
  std::uint32_t last = kNobody;  // observations of a point follow each other
  for (std::size_t i = 0; i < all.problem.observations.size(); ++i) {
    BundleProblem::Observation o = all.problem.observations[i];
    if (!cameras[o.camera]) continue;
    if (o.point != last) {
      last = o.point;
      kept.points.push_back(all.points[last]);
      kept.problem.points.push_back(all.problem.points[last]);
    }
    o.camera = kept.camera_of.at(all.keyframes[o.camera]);
    o.point = static_cast<std::uint32_t>(kept.points.size() - 1);
    kept.problem.observations.push_back(o);
    kept.keypoints.push_back(all.keypoints[i]);
    kept.kinds.push_back(all.kinds[i]);
  }
  return kept;
}

/// Copies points in slices, between which others may write. Tracking writes to the map at every
/// frame, and would otherwise wait for a large map.
void gather_points(const Map& map, const std::vector<MapPointId>& ids, GatheredBundle& bundle) {
  constexpr std::size_t kSlice = 2048;
  for (std::size_t begin = 0; begin < ids.size(); begin += kSlice) {
    const auto lock = map.read_lock();
    if (map.epoch() != bundle.epoch) return;  // nothing of it will be committed
    const std::size_t end = std::min(begin + kSlice, ids.size());
    for (std::size_t i = begin; i < end; ++i) {
      const MapPoint* point = map.find(ids[i]);
      if (!point || !point->position.allFinite()) continue;
      const std::size_t n_before = bundle.problem.observations.size();
      bundle.add_point(*point, map);
      if (bundle.problem.observations.size() > n_before) continue;
      bundle.points.pop_back();
      bundle.problem.points.pop_back();
    }
  }
}

}  // namespace

GatheredBundle gather_full_bundle(const Map& map, MapIndex which) {
  GatheredBundle bundle(map);
  std::vector<MapPointId> points;
  {
    const auto lock = map.read_lock();
    bundle = GatheredBundle(map);
    bundle.map_index = which == kNoMap ? map.active_map() : which;
    map.for_each_keyframe([&](const KeyFrame& keyframe) {
      if (keyframe.map == bundle.map_index) bundle.add_camera(keyframe, false);
    });
    points.reserve(map.n_points());
    map.for_each_point([&](const MapPoint& point) {
      if (map.is_in(point, bundle.map_index)) points.push_back(point.id);
    });
  }
  gather_points(map, points, bundle);
  if (bundle.keyframes.empty()) return bundle;
  const std::vector<bool> tied = largest_part(bundle.problem);
  if (std::count(tied.begin(), tied.end(), false) > 0) bundle = reduce(bundle, tied, map);
  bundle.problem.cameras.front().fixed = true;
  return bundle;
}

}  // namespace orbslam
