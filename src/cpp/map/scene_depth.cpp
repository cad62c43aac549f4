// SPDX-License-Identifier: BSD-3-Clause
#include "map/scene_depth.hpp"

#include <algorithm>
#include <vector>

namespace orbslam {

std::optional<double> median_scene_depth(const Map& map, const KeyFrame& keyframe) {
  std::vector<double> depths;
  for (const MapPointId id : keyframe.map_points) {
    if (const MapPoint* point = map.find(id)) {
      depths.push_back((keyframe.T_cw * point->position).z());
    }
  }
  if (depths.empty()) return std::nullopt;
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>((depths.size() - 1) / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

}  // namespace orbslam
