// SPDX-License-Identifier: BSD-3-Clause
#include "map/scene_depth.hpp"

#include <algorithm>
#include <vector>

namespace orbslam {

std::optional<double> median_scene_depth(const Map& map, const KeyFrame& keyframe) {
  std::vector<double> depths;
  const bool flat = keyframe.frame->camera->is_flat();
  for (const MapPointId id : keyframe.map_points) {
    if (const MapPoint* point = map.find(id)) {
      const Eigen::Vector3d p_c = keyframe.T_cw * point->position;
      // A fisheye lens also shows points beside and behind the camera.
      depths.push_back(flat ? p_c.z() : p_c.norm());
    }
  }
  if (depths.empty()) return std::nullopt;
  const auto middle = depths.begin() + static_cast<std::ptrdiff_t>((depths.size() - 1) / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  return *middle;
}

}  // namespace orbslam
