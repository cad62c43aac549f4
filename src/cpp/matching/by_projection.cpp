// SPDX-License-Identifier: BSD-3-Clause
#include "matching/by_projection.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "base/errors.hpp"
#include "map/point_batch.hpp"
#include "matching/id_index.hpp"
#include "matching/orientation_consistency.hpp"
#include "matching/projector.hpp"

namespace orbslam {
namespace {

constexpr int kAllBits = 256;
constexpr float kLocalMapRatio = 0.8F;
constexpr std::int32_t kUnmatched = -1;

const Pose& require_pose(const TrackedFrame& frame, const char* verb) {
  if (!frame.T_cw) {
    throw StateError(std::string(verb) + ": frame " + std::to_string(frame.frame->id) +
                     " has no pose; predict one first");
  }
  return *frame.T_cw;
}

// Temporary points have no observations; any point may replace them.
bool holds_mapped_point(const TrackedFrame& frame, std::size_t keypoint) {
  const MapPointId held = frame.map_points[keypoint];
  return held.valid() && !is_temporary(held);
}

// A candidate that agrees in the left image may disagree in the right one.
bool right_column_disagrees(const Frame& frame, std::size_t keypoint, double right_u,
                            float radius) {
  return frame.has_depth(keypoint) &&
         std::abs(right_u - static_cast<double>(frame.right_u[keypoint])) >
             static_cast<double>(radius);
}

struct Best {
  std::uint32_t keypoint = 0;
  int distance = kAllBits;
};

// The candidate with the most similar descriptor (the first of equals) among those allowed.
template <class Allowed>
Best find_best(const Frame& frame, const Descriptor& wanted,
               const std::vector<std::uint32_t>& candidates, Allowed&& allowed) {
  Best best;
  for (const std::uint32_t candidate : candidates) {
    if (!allowed(candidate)) continue;
    const int distance = hamming_distance(wanted, frame.descriptors[candidate]);
    if (distance < best.distance) best = {candidate, distance};
  }
  return best;
}

// Which keypoint of the other image each keypoint of a frame was matched from in one search.
// A keypoint that is taken again keeps one entry, that of the final match.
class MatchRecord {
 public:
  explicit MatchRecord(std::size_t n) : from_(buffer()) { from_.assign(n, kUnmatched); }

  void set(std::size_t keypoint, std::size_t from) {
    from_[keypoint] = static_cast<std::int32_t>(from);
  }

  // Drops the matches whose rotation disagrees with the majority from the frame; `from` are the
  // keypoints of the other image. Returns the number of those that stay.
  int keep_consistent(const std::vector<Keypoint>& from, TrackedFrame& frame) const {
    thread_local OrientationHistogram rotations;
    rotations.clear();
    int n_matches = 0;
    for (std::size_t i = 0; i < from_.size(); ++i) {
      if (from_[i] == kUnmatched) continue;
      ++n_matches;
      rotations.add(static_cast<std::uint32_t>(i), from[static_cast<std::size_t>(from_[i])].angle,
                    frame.frame->keypoints[i].angle);
    }
    for (const std::uint32_t i : rotations.inconsistent()) {
      frame.dissociate(i);
      --n_matches;
    }
    return n_matches;
  }

 private:
  static std::vector<std::int32_t>& buffer() {
    thread_local std::vector<std::int32_t> reused;
    return reused;
  }
  std::vector<std::int32_t>& from_;
};

struct LevelRange {
  int lowest = 0;
  int highest = 0;  // negative: no limit
};

enum class Motion { kSideways, kForward, kBackward };

// After a motion along the axis by more than the baseline, everything appears larger or smaller.
Motion motion_along_axis(const Pose& T_cw, const Pose& T_lw, double baseline) {
  const double z = (T_lw * T_cw.center()).z();
  if (z > baseline) return Motion::kForward;
  if (-z > baseline) return Motion::kBackward;
  return Motion::kSideways;
}

LevelRange expected_levels(Motion motion, int last_level) {
  switch (motion) {
    case Motion::kForward:
      return {last_level, -1};
    case Motion::kBackward:
      return {0, last_level};
    case Motion::kSideways:
      break;
  }
  return {last_level - 1, last_level + 1};
}

void require_ascending(const std::vector<MapPointId>& ids, const char* what) {
  if (!std::is_sorted(ids.begin(), ids.end())) {
    throw StateError(std::string(what) + " must be ascending point ids; sort them first");
  }
}

}  // namespace

int match_last_frame(TrackedFrame& current, const TrackedFrame& last, const PointBatch& points,
                     float radius, bool use_depth) {
  const Pose& T_cw = require_pose(current, "match_last_frame");
  const Pose& T_lw = require_pose(last, "match_last_frame");
  const Frame& frame = *current.frame;
  const Projector projector(frame, T_cw);
  // The cameras of a rig look in different directions.
  const bool one_axis = use_depth && !frame.camera->is_rig();
  const Motion motion =
      one_axis ? motion_along_axis(T_cw, T_lw, frame.camera->baseline()) : Motion::kSideways;

  thread_local PointIdIndex batch_index;
  batch_index.reset(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    batch_index.insert(points.ids[i], static_cast<std::int32_t>(i));
  }
  thread_local std::vector<std::uint32_t> candidates;
  MatchRecord record(frame.size());

  for (std::size_t i = 0; i < last.map_points.size(); ++i) {
    if (last.outlier[i]) continue;
    const std::int32_t point = batch_index.find(last.map_points[i]);
    if (point == PointIdIndex::kNone) continue;
    ImagePoint image;
    if (!projector.project_into_frame(last.positions[i], image)) continue;

    const int level = last.frame->keypoints[i].level;
    const float window = radius * frame.scales->scale(level);
    const LevelRange levels = expected_levels(motion, level);
    frame.grid.features_in_area(frame.keypoints, static_cast<float>(image.u),
                                static_cast<float>(image.v), window, levels.lowest, levels.highest,
                                candidates);
    const auto allowed = [&](std::size_t candidate) {
      return !holds_mapped_point(current, candidate) &&
             !right_column_disagrees(frame, candidate, image.right_u, window);
    };
    const Descriptor& wanted = points.descriptors[static_cast<std::size_t>(point)];
    const Best best = find_best(frame, wanted, candidates, allowed);
    if (best.distance > kDescriptorHigh) continue;
    current.associate(best.keypoint, last.map_points[i], last.positions[i]);
    record.set(best.keypoint, i);
  }
  return record.keep_consistent(last.frame->keypoints, current);
}

namespace {

// The frustum test of one point; `view` is reset.
void look_at(const Projector& projector, const ScalePyramid& scales, const PointBatch& points,
             std::size_t i, FrustumView& view) {
  view = FrustumView();
  ImagePoint image;
  if (!projector.project_into_frame(points.positions[i], image)) return;
  const Eigen::Vector3d ray = points.positions[i] - projector.center(image);
  const double distance = ray.norm();
  if (!in_scale_range(distance, points.min_distances[i], points.max_distances[i])) return;
  const double along = ray.dot(points.mean_directions[i]);
  if (!seen_from_near_direction(along, distance)) return;

  view.u = static_cast<float>(image.u);
  view.v = static_cast<float>(image.v);
  view.right_u = static_cast<float>(image.right_u);
  view.view_cosine = static_cast<float>(along / distance);
  view.level = scales.predict_level(points.max_distances[i], distance);
  view.visible = true;
}

// The keypoint that match_local_map() gives to a point in view, or kUnmatched.
std::int64_t find_in_view(const TrackedFrame& tracked, const FrustumView& view,
                          const Descriptor& wanted, float radius_factor,
                          std::vector<std::uint32_t>& candidates) {
  const Frame& frame = *tracked.frame;
  const float window =
      viewing_radius(view.view_cosine) * radius_factor * frame.scales->scale(view.level);
  frame.grid.features_in_area(frame.keypoints, view.u, view.v, window, view.level - 1, view.level,
                              candidates);
  std::int64_t match = kUnmatched;
  int best = kAllBits, second = kAllBits;
  std::int32_t best_level = -1, second_level = -1;
  for (const std::uint32_t candidate : candidates) {
    if (holds_mapped_point(tracked, candidate)) continue;
    if (right_column_disagrees(frame, candidate, static_cast<double>(view.right_u), window)) {
      continue;
    }
    const int distance = hamming_distance(wanted, frame.descriptors[candidate]);
    const std::int32_t level = frame.keypoints[candidate].level;
    if (distance < best) {
      second = best;
      second_level = best_level;
      best = distance;
      best_level = level;
      match = candidate;
    } else if (distance < second) {
      second = distance;
      second_level = level;
    }
  }
  if (best > kDescriptorHigh) return kUnmatched;
  // Neighbouring levels describe the same corner twice, so only equal levels can be ambiguous.
  const bool ambiguous = best_level == second_level &&
                         static_cast<float>(best) > kLocalMapRatio * static_cast<float>(second);
  return ambiguous ? kUnmatched : match;
}

}  // namespace

std::vector<FrustumView> project_into(const TrackedFrame& frame, const PointBatch& points) {
  const Projector projector(*frame.frame, require_pose(frame, "project_into"));
  std::vector<FrustumView> views(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    look_at(projector, *frame.frame->scales, points, i, views[i]);
  }
  return views;
}

LocalMapMatches match_local_map(TrackedFrame& frame, const PointBatch& local_points,
                                const std::vector<MapPointId>& exclude, float radius_factor) {
  const Projector projector(*frame.frame, require_pose(frame, "match_local_map"));
  thread_local PointIdIndex known;
  known.reset(frame.map_points.size() + exclude.size());
  for (const auto* ids : {&std::as_const(frame.map_points), &exclude}) {
    for (const MapPointId id : *ids) {
      if (id.valid()) known.insert(id, 0);
    }
  }

  thread_local std::vector<std::uint32_t> candidates;
  LocalMapMatches result;
  FrustumView view;
  for (std::size_t i = 0; i < local_points.size(); ++i) {
    if (known.find(local_points.ids[i]) != PointIdIndex::kNone) continue;
    look_at(projector, *frame.frame->scales, local_points, i, view);
    if (!view.visible) continue;
    result.visible.push_back(local_points.ids[i]);
    const std::int64_t match =
        find_in_view(frame, view, local_points.descriptors[i], radius_factor, candidates);
    if (match == kUnmatched) continue;
    frame.associate(static_cast<std::size_t>(match), local_points.ids[i],
                    local_points.positions[i]);
    ++result.n_matches;
  }
  return result;
}

namespace {

// The points of a keyframe that are not in `found`, and the keypoints they belong to.
std::shared_ptr<const Frame> gather_unfound(const Map& map, KeyFrameId id,
                                            const std::vector<MapPointId>& found,
                                            PointBatch& points,
                                            std::vector<std::uint32_t>& keypoints) {
  points.clear();
  keypoints.clear();
  const auto lock = map.read_lock();
  const KeyFrame* keyframe = map.find(id);
  if (!keyframe) return nullptr;
  for (std::size_t i = 0; i < keyframe->map_points.size(); ++i) {
    const MapPoint* point = map.find(keyframe->map_points[i]);
    if (!point || std::binary_search(found.begin(), found.end(), point->id)) continue;
    points.push_back(*point);
    keypoints.push_back(static_cast<std::uint32_t>(i));
  }
  return keyframe->frame;
}

}  // namespace

int match_keyframe_by_projection(const Map& map, KeyFrameId keyframe, TrackedFrame& frame,
                                 const std::vector<MapPointId>& found, float radius_factor,
                                 int max_distance) {
  const Projector projector(*frame.frame, require_pose(frame, "match_keyframe_by_projection"));
  require_ascending(found, "match_keyframe_by_projection: found");
  PointBatch points;
  std::vector<std::uint32_t> keypoints;
  const auto source = gather_unfound(map, keyframe, found, points, keypoints);
  if (!source) return 0;

  const Frame& target = *frame.frame;
  thread_local std::vector<std::uint32_t> candidates;
  MatchRecord record(target.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    ImagePoint image;
    if (!projector.project_into_frame(points.positions[i], image)) continue;
    const double distance = (points.positions[i] - projector.center(image)).norm();
    if (!in_scale_range(distance, points.min_distances[i], points.max_distances[i])) continue;

    const int level = target.scales->predict_level(points.max_distances[i], distance);
    target.grid.features_in_area(
        target.keypoints, static_cast<float>(image.u), static_cast<float>(image.v),
        radius_factor * target.scales->scale(level), level - 1, level + 1, candidates);
    const auto allowed = [&](std::size_t candidate) {
      return !frame.map_points[candidate].valid();
    };
    const Best best = find_best(target, points.descriptors[i], candidates, allowed);
    if (best.distance > max_distance) continue;
    frame.associate(best.keypoint, points.ids[i], points.positions[i]);
    record.set(best.keypoint, keypoints[i]);
  }
  return record.keep_consistent(source->keypoints, frame);
}

}  // namespace orbslam
