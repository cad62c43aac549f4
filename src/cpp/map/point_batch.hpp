// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "map/map.hpp"

namespace orbslam {

/// Copies of map points as flat arrays, gathered under one short read lock, so that searches run
/// without locks on data that does not change under them. See docs/method/threads.md#locks.
struct PointBatch {
  std::vector<MapPointId> ids;
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Vector3d> mean_directions;
  std::vector<double> min_distances, max_distances;
  std::vector<Descriptor> descriptors;

  std::size_t size() const { return ids.size(); }
  void clear();
  void reserve(std::size_t n);
  void push_back(const MapPoint& point);
};

/// The living points among `ids` (invalid ids and dead points are left out), in the given order.
/// Takes the map's read lock.
PointBatch gather_points(const Map& map, const std::vector<MapPointId>& ids);

}  // namespace orbslam
