// SPDX-License-Identifier: BSD-3-Clause
#include "matching/by_sim3.hpp"

#include <memory>
#include <stdexcept>
#include <string>

#include "matching/by_projection.hpp"
#include "matching/id_index.hpp"
#include "matching/projector.hpp"

namespace orbslam {
namespace {

constexpr std::int32_t kNoMatch = -1;

void require_size(const std::vector<MapPointId>& matches, const Frame& frame,
                  const char* function) {
  if (matches.size() != frame.size()) {
    throw std::invalid_argument(std::string(function) + ": matches must have one entry per " +
                                "keypoint of the keyframe");
  }
}

/// Copy of one of two keyframes, made under the lock: its pose, the points to search for in the
/// other keyframe, and their keypoints.
struct Side {
  std::shared_ptr<const Frame> frame;
  Pose T_cw;
  PointBatch points;
  std::vector<std::uint32_t> keypoints;
};

void copy_points(const Map& map, const KeyFrame& keyframe, const std::vector<std::uint8_t>& marked,
                 Side& side) {
  side.frame = keyframe.frame;
  side.T_cw = keyframe.T_cw;
  for (std::size_t i = 0; i < keyframe.map_points.size(); ++i) {
    const MapPoint* point = marked[i] ? nullptr : map.find(keyframe.map_points[i]);
    if (!point) continue;
    side.points.push_back(*point);
    side.keypoints.push_back(static_cast<std::uint32_t>(i));
  }
}

struct Search {
  double u = 0, v = 0;
  int level = 0;
  float radius_factor = 0;
  int max_difference = 0;
};

/// The keypoint near (u, v), on the level or the finer one, whose descriptor differs least.
/// `free(keypoint)` says which may be taken.
template <class Free>
std::int32_t best_keypoint(const Frame& frame, const Search& search, const Descriptor& descriptor,
                           const Free& free) {
  thread_local std::vector<std::uint32_t> candidates;
  frame.grid.features_in_area(frame.keypoints, static_cast<float>(search.u),
                              static_cast<float>(search.v),
                              search.radius_factor * frame.scales->scale(search.level),
                              search.level - 1, search.level, candidates);
  int least = search.max_difference + 1;
  std::int32_t best = kNoMatch;
  for (const std::uint32_t candidate : candidates) {
    if (!free(candidate)) continue;
    const int difference = hamming_distance(descriptor, frame.descriptors[candidate]);
    if (difference >= least) continue;
    least = difference;
    best = static_cast<std::int32_t>(candidate);
  }
  return best;
}

/// Per keypoint of `from`, the keypoint of `to` that shows its point; S maps camera coordinates of
/// `from` into `to`.
std::vector<std::int32_t> search_one_way(const Side& from, const Frame& to, const Similarity& S,
                                         float radius_factor) {
  std::vector<std::int32_t> found(from.frame->size(), kNoMatch);
  for (std::size_t i = 0; i < from.points.size(); ++i) {
    const Eigen::Vector3d p = S * (from.T_cw * from.points.positions[i]);
    Eigen::Vector2d pixel;
    if (!to.camera->project(p, pixel)) continue;
    if (!to.camera->bounds().contains_half_open(pixel.x(), pixel.y())) continue;
    // In the units of the point's own map, like its scale range.
    const double distance = (p - to.camera->centre(pixel.x())).norm() / S.scale();
    const double farthest = from.points.max_distances[i];
    if (!in_scale_range(distance, from.points.min_distances[i], farthest)) continue;
    const int level = to.scales->predict_level(farthest, distance);
    found[from.keypoints[i]] =
        best_keypoint(to, {pixel.x(), pixel.y(), level, radius_factor, kDescriptorHigh},
                      from.points.descriptors[i], [](std::uint32_t) { return true; });
  }
  return found;
}

/// Searches points of the world from the pose of S_cw. Calls `take(point, keypoint)` for every
/// match before the next point is searched.
template <class Free, class Take>
void search_loop_points(const Frame& frame, const Similarity& S_cw, const PointBatch& points,
                        float radius_factor, const Free& free, const Take& take) {
  const Projector projector(frame, S_cw.pose());
  for (std::size_t i = 0; i < points.size(); ++i) {
    ExpectedView view;
    if (!expect_in_keyframe(projector, frame, points, i, view)) continue;
    const auto& [image, level] = view;
    const std::int32_t best =
        best_keypoint(frame, {image.u, image.v, level, radius_factor, kDescriptorLow},
                      points.descriptors[i], free);
    if (best != kNoMatch) take(i, static_cast<std::uint32_t>(best));
  }
}

}  // namespace

int match_by_similarity(const Map& map, KeyFrameId a, KeyFrameId b, const Similarity& S_ab,
                        std::vector<MapPointId>& matches, float radius_factor) {
  Side side_a, side_b;
  std::vector<MapPointId> points_of_b;
  {
    const auto lock = map.read_lock();
    const KeyFrame* keyframe_a = map.find(a);
    const KeyFrame* keyframe_b = map.find(b);
    if (!keyframe_a || !keyframe_b) return 0;
    require_size(matches, *keyframe_a->frame, "match_by_similarity");
    std::vector<std::uint8_t> marked_a(matches.size(), 0), marked_b(keyframe_b->frame->size(), 0);
    for (std::size_t i = 0; i < matches.size(); ++i) {
      if (!matches[i].valid()) continue;
      marked_a[i] = 1;
      const MapPoint* point = map.find(matches[i]);
      const Observation* seen = point ? point->observation_of(b) : nullptr;
      if (seen) marked_b[seen->index] = 1;
    }
    copy_points(map, *keyframe_a, marked_a, side_a);
    copy_points(map, *keyframe_b, marked_b, side_b);
    points_of_b = keyframe_b->map_points;
  }
  const auto forth = search_one_way(side_a, *side_b.frame, S_ab.inverse(), radius_factor);
  const auto back = search_one_way(side_b, *side_a.frame, S_ab, radius_factor);
  int n_new = 0;
  for (std::size_t i = 0; i < forth.size(); ++i) {
    if (forth[i] == kNoMatch) continue;
    const auto j = static_cast<std::size_t>(forth[i]);
    if (back[j] != static_cast<std::int32_t>(i)) continue;
    matches[i] = points_of_b[j];
    ++n_new;
  }
  return n_new;
}

int match_loop_points(const Map& map, KeyFrameId keyframe, const Similarity& S_cw,
                      const std::vector<MapPointId>& points, std::vector<MapPointId>& matches,
                      float radius_factor) {
  std::shared_ptr<const Frame> frame;
  PointBatch batch;
  {
    const auto lock = map.read_lock();
    const KeyFrame* found = map.find(keyframe);
    if (!found) return 0;
    frame = found->frame;
    require_size(matches, *frame, "match_loop_points");
    PointIdIndex matched;
    matched.reset(matches.size());
    for (const MapPointId id : matches) {
      if (id.valid()) matched.insert(id, 0);
    }
    for (const MapPointId id : points) {
      const MapPoint* point = map.find(id);
      if (point && matched.find(id) == PointIdIndex::kNone) batch.push_back(*point);
    }
  }
  int n_new = 0;
  search_loop_points(
      *frame, S_cw, batch, radius_factor,
      [&](std::uint32_t candidate) { return !matches[candidate].valid(); },
      [&](std::size_t point, std::uint32_t keypoint) {
        matches[keypoint] = batch.ids[point];
        ++n_new;
      });
  return n_new;
}

std::vector<PointSighting> find_loop_fusions(const Frame& frame, const Similarity& S_cw,
                                             const PointBatch& points, float radius_factor) {
  std::vector<PointSighting> found;
  search_loop_points(
      frame, S_cw, points, radius_factor, [](std::uint32_t) { return true; },
      [&](std::size_t point, std::uint32_t keypoint) {
        found.push_back({points.ids[point], keypoint});
      });
  return found;
}

}  // namespace orbslam
