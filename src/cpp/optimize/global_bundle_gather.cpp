// SPDX-License-Identifier: BSD-3-Clause
// What a full bundle adjustment works on.
#include <algorithm>
#include <numeric>
#include <vector>

#include "optimize/global_bundle_adjustment.hpp"

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

/// Takes away the other cameras, the points that only they see, and those that are nowhere.
GatheredBundle reduce(const GatheredBundle& all, const std::vector<bool>& cameras, const Map& map) {
  GatheredBundle kept(map);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (cameras[i]) kept.add_camera(*map.find(all.keyframes[i]), false);
  }
  std::vector<bool> seen(all.points.size(), false);
  for (const BundleProblem::Observation& o : all.problem.observations) {
    if (cameras[o.camera]) seen[o.point] = true;
  }
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (seen[i]) kept.add_point(*map.find(all.points[i]), map);
  }
  return kept;
}

}  // namespace

GatheredBundle gather_global_bundle(const Map& map) {
  const auto lock = map.read_lock();
  GatheredBundle bundle(map);
  map.for_each_keyframe([&](const KeyFrame& keyframe) { bundle.add_camera(keyframe, false); });
  map.for_each_point([&](const MapPoint& point) {
    if (!point.observations.empty() && point.position.allFinite()) bundle.add_point(point, map);
  });
  if (bundle.keyframes.empty()) return bundle;
  const std::vector<bool> tied = largest_part(bundle.problem);
  if (std::count(tied.begin(), tied.end(), false) > 0) bundle = reduce(bundle, tied, map);
  bundle.problem.cameras.front().fixed = true;
  return bundle;
}

}  // namespace orbslam
