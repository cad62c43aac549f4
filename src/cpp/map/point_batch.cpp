// SPDX-License-Identifier: BSD-3-Clause
#include "map/point_batch.hpp"

namespace orbslam {

void PointBatch::clear() {
  ids.clear();
  positions.clear();
  mean_directions.clear();
  min_distances.clear();
  max_distances.clear();
  descriptors.clear();
}

void PointBatch::reserve(std::size_t n) {
  ids.reserve(n);
  positions.reserve(n);
  mean_directions.reserve(n);
  min_distances.reserve(n);
  max_distances.reserve(n);
  descriptors.reserve(n);
}

void PointBatch::push_back(const MapPoint& point) {
  ids.push_back(point.id);
  positions.push_back(point.position);
  mean_directions.push_back(point.mean_direction);
  min_distances.push_back(point.min_distance);
  max_distances.push_back(point.max_distance);
  descriptors.push_back(point.descriptor);
}

PointBatch gather_points(const Map& map, const std::vector<MapPointId>& ids) {
  PointBatch batch;
  batch.reserve(ids.size());
  const auto lock = map.read_lock();
  for (const MapPointId id : ids) {
    if (const MapPoint* point = map.find(id)) batch.push_back(*point);
  }
  return batch;
}

}  // namespace orbslam
