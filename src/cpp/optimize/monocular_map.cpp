// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/monocular_map.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/errors.hpp"
#include "map/anchor.hpp"
#include "map/scene_depth.hpp"
#include "optimize/full_bundle_adjustment.hpp"

namespace orbslam {
namespace {

constexpr int kIterations = 20;

void check_described(const Frame& frame) {
  if (frame.described) return;
  throw StateError("create_monocular_map: frame " + std::to_string(frame.id) +
                   " has no words; describe() it first");
}

void check_matches(const Frame& initial, const Frame& current, const std::vector<int>& matches,
                   const std::vector<Eigen::Vector3d>& points) {
  if (matches.size() != initial.size() || points.size() != initial.size()) {
    throw StateError("create_monocular_map: " + std::to_string(matches.size()) + " matches and " +
                     std::to_string(points.size()) + " points for " +
                     std::to_string(initial.size()) +
                     " initial keypoints; give one of each per keypoint");
  }
  std::vector<bool> taken(current.size(), false);
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (matches[i] < 0) continue;
    const auto j = static_cast<std::size_t>(matches[i]);
    if (j >= current.size() || taken[j]) {
      throw StateError("create_monocular_map: initial keypoint " + std::to_string(i) +
                       " is matched to " + std::to_string(j) +
                       ", which does not exist or is taken; matches must be one to one");
    }
    taken[j] = true;
  }
}

void add_points(Map& map, const MonocularMap& made, FrameId frame, const std::vector<int>& matches,
                const std::vector<Eigen::Vector3d>& points) {
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (matches[i] < 0 || !points[i].allFinite()) continue;
    const MapPointId id = map.add_point(points[i], made.second, frame);
    map.add_observation(id, made.first, i);
    map.add_observation(id, made.second, static_cast<std::size_t>(matches[i]));
    map.update_point(id);
  }
}

/// Makes keyframes, points and covisibility. `epoch`: of the map that they belong to.
MonocularMap build(Map& map, const TrackedFrame& initial, const TrackedFrame& current,
                   const Pose& T_21, const std::vector<int>& matches,
                   const std::vector<Eigen::Vector3d>& points, std::uint64_t& epoch) {
  const auto lock = map.write_lock();
  epoch = map.epoch();
  if (map.root(map.active_map()).valid()) {
    throw StateError(
        "create_monocular_map: the map holds keyframes already; clear() it, or begin_map() first");
  }
  MonocularMap made;
  made.first = map.add_keyframe(initial.frame, Pose());
  made.second = map.add_keyframe(current.frame, T_21);
  add_points(map, made, current.frame->id, matches, points);
  map.update_connections(made.first);
  map.update_connections(made.second);
  return made;
}

int count_points(const Map& map, KeyFrameId id) {
  const auto& slots = map.find(id)->map_points;
  return static_cast<int>(std::count_if(
      slots.begin(), slots.end(), [&](MapPointId point) { return map.find(point) != nullptr; }));
}

/// The first keyframe is the origin, so scaling about it leaves its pose as it is. Scale range and
/// direction of every point are scaled too. The original does not change them, so the first frames
/// miss points or search them on the wrong level.
void scale_map(Map& map, KeyFrameId second, double factor) {
  const Pose& T_21 = map.find(second)->T_cw;
  map.set_pose(second, Pose(T_21.rotation(), factor * T_21.translation()));
  std::vector<MapPointId> ids;
  map.for_each_point([&](const MapPoint& point) {
    if (map.is_in(point, map.find(second)->map)) ids.push_back(point.id);
  });
  for (const MapPointId id : ids) {
    map.set_position(id, factor * map.find(id)->position);
    map.update_geometry(id);
  }
}

/// Scales the median depth to 1, under the write lock. All checks come before the scaling.
MonocularMapFailure normalise(Map& map, MonocularMap& made, std::size_t min_points) {
  made.n_points = count_points(map, made.second);
  const auto depth = median_scene_depth(map, *map.find(made.first));
  if (depth) made.median_depth = *depth;
  if (made.n_points == 0 || static_cast<std::size_t>(made.n_points) < min_points) {
    return MonocularMapFailure::kFewPoints;
  }
  const double factor = 1 / made.median_depth;
  // Also false for a median of zero, infinity or NaN.
  const bool usable = factor > 0 && std::isfinite(factor);
  if (!usable) return MonocularMapFailure::kBadDepth;
  scale_map(map, made.second, factor);
  return MonocularMapFailure::kNone;
}

void take_over(const Map& map, KeyFrameId id, TrackedFrame& frame) {
  const KeyFrame& keyframe = *map.find(id);
  frame.clear_associations();
  frame.T_cw = keyframe.T_cw;
  frame.anchor = anchor_at(map, id);
  for (std::size_t i = 0; i < keyframe.map_points.size(); ++i) {
    const MapPoint* point = map.find(keyframe.map_points[i]);
    if (point != nullptr) frame.associate(i, point->id, point->position);
  }
}

}  // namespace

MonocularMap create_monocular_map(Map& map, TrackedFrame& initial, TrackedFrame& current,
                                  const Pose& T_21, const std::vector<int>& matches,
                                  const std::vector<Eigen::Vector3d>& points,
                                  std::size_t min_points) {
  check_described(*initial.frame);
  check_described(*current.frame);
  check_matches(*initial.frame, *current.frame, matches, points);
  std::uint64_t epoch = 0;
  MonocularMap made = build(map, initial, current, T_21, matches, points, epoch);
  GatheredBundle bundle = gather_full_bundle(map);
  made.summary = solve_full_bundle(bundle, {kIterations, true}, nullptr, 1);

  const auto lock = map.write_lock();
  if (map.epoch() != epoch) {
    made.failure = MonocularMapFailure::kMapCleared;
    return made;
  }
  if (made.summary.iterations > 0) write_back(bundle, map);
  made.failure = normalise(map, made, min_points);
  made.ok = made.failure == MonocularMapFailure::kNone;
  if (!made.ok) return made;
  map.publish(made.first);
  map.publish(made.second);
  take_over(map, made.first, initial);
  take_over(map, made.second, current);
  return made;
}

}  // namespace orbslam
