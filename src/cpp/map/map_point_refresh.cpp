// SPDX-License-Identifier: BSD-3-Clause
// Map: the fields of a point that follow from its observations.
#include <algorithm>
#include <array>

#include "map/map.hpp"

namespace orbslam {
namespace {

/// Points rarely have more observers than this; their matrices of distances fit on the stack.
constexpr std::size_t kSmall = 24;

/// Row of the symmetric n x n matrix of distances whose median is least, ties to the first row.
/// The median is the element floor((n - 1) / 2) of the sorted row, its zero included.
std::size_t least_median_row(const Descriptor* descriptors, std::size_t n, std::uint16_t* distances,
                             std::uint16_t* row) {
  for (std::size_t i = 0; i < n; ++i) {
    distances[i * n + i] = 0;
    for (std::size_t j = i + 1; j < n; ++j) {
      const auto d = static_cast<std::uint16_t>(hamming_distance(descriptors[i], descriptors[j]));
      distances[i * n + j] = d;
      distances[j * n + i] = d;
    }
  }
  const std::size_t middle = (n - 1) / 2;
  std::size_t best_row = 0;
  int best = 257;
  for (std::size_t i = 0; i < n; ++i) {
    const std::uint16_t* values = distances + i * n;
    // A row can only win when more than `middle` of its values are below the best median so far;
    // counting is much cheaper than selecting.
    std::size_t below = 0;
    for (std::size_t j = 0; j < n; ++j) below += values[j] < best ? 1 : 0;
    if (below <= middle) continue;
    std::copy_n(values, n, row);
    std::nth_element(row, row + middle, row + n);
    best = row[middle];
    best_row = i;
  }
  return best_row;
}

}  // namespace

void Map::refresh_descriptor(MapPoint& refreshed) {
  const auto& observations = refreshed.observations;
  const std::size_t n = observations.size();
  if (n == 0) return;
  const auto observed = [this](const Observation& o) -> const Descriptor& {
    return keyframe(o.keyframe).frame->descriptors[o.index];
  };
  if (n <= 2) {  // every median is the zero of the diagonal: the first wins
    refreshed.descriptor = observed(observations.front());
    return;
  }
  if (n <= kSmall) {
    std::array<Descriptor, kSmall> descriptors;
    std::array<std::uint16_t, kSmall * kSmall> distances;
    std::array<std::uint16_t, kSmall> row;
    for (std::size_t i = 0; i < n; ++i) descriptors[i] = observed(observations[i]);
    refreshed.descriptor =
        descriptors[least_median_row(descriptors.data(), n, distances.data(), row.data())];
    return;
  }
  thread_local std::vector<Descriptor> descriptors;
  thread_local std::vector<std::uint16_t> distances;
  descriptors.resize(n);
  distances.resize(n * n + n);
  for (std::size_t i = 0; i < n; ++i) descriptors[i] = observed(observations[i]);
  refreshed.descriptor = descriptors[least_median_row(descriptors.data(), n, distances.data(),
                                                      distances.data() + n * n)];
}

PointGeometry Map::geometry_at(const MapPoint& point, const Eigen::Vector3d& position,
                               const std::vector<Eigen::Vector3d>& centers) const {
  PointGeometry geometry{position, point.mean_direction, point.min_distance, point.max_distance};
  if (point.observations.empty()) return geometry;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < point.observations.size(); ++k) {
    const Observation& observation = point.observations[k];
    const Eigen::Vector3d ray = position - centers[k];
    const double distance = ray.norm();
    if (distance > 0) sum += ray / distance;
    if (observation.keyframe != point.reference_keyframe) continue;
    const Frame& frame = *keyframe(observation.keyframe).frame;
    geometry.max_distance =
        distance * frame.scales->scale(frame.keypoints[observation.index].level);
    geometry.min_distance = geometry.max_distance / frame.scales->scale(frame.scales->levels() - 1);
  }
  geometry.mean_direction = sum / static_cast<double>(point.observations.size());
  return geometry;
}

void Map::refresh_geometry(MapPoint& refreshed) {
  thread_local std::vector<Eigen::Vector3d> centers;
  centers.clear();
  for (const Observation& observation : refreshed.observations) {
    centers.push_back(keyframe(observation.keyframe).center_of(observation.index));
  }
  const PointGeometry geometry = geometry_at(refreshed, refreshed.position, centers);
  refreshed.mean_direction = geometry.mean_direction;
  refreshed.min_distance = geometry.min_distance;
  refreshed.max_distance = geometry.max_distance;
}

void Map::update_descriptor(MapPointId id) {
  if (!find(id)) return;
  refresh_descriptor(changing(id));
}

void Map::update_geometry(MapPointId id) {
  if (!find(id)) return;
  refresh_geometry(changing(id));
}

}  // namespace orbslam
