// SPDX-License-Identifier: BSD-3-Clause
#include "map/sightings.hpp"

#include "base/sort_unique.hpp"

namespace orbslam {

void count_sightings(const Map& map, const TrackedFrame& frame,
                     const std::vector<MapPointId>& in_view) {
  // Counts each point once: a point in view may also be matched.
  thread_local std::vector<MapPointId> visible;
  visible.assign(in_view.begin(), in_view.end());
  for (const MapPointId id : frame.map_points) {
    if (id.valid()) visible.push_back(id);
  }
  sort_unique(visible);

  const auto lock = map.read_lock();
  for (const MapPointId id : visible) {
    if (map.find(id)) map.count_visible(id);
  }
  for (std::size_t i = 0; i < frame.map_points.size(); ++i) {
    if (frame.outlier[i] == 0 && map.find(frame.map_points[i]))
      map.count_found(frame.map_points[i]);
  }
}

}  // namespace orbslam
