// SPDX-License-Identifier: BSD-3-Clause
#include "matching/fuse.hpp"

#include <algorithm>
#include <memory>

#include "matching/by_projection.hpp"
#include "matching/id_index.hpp"
#include "matching/pose_guard.hpp"
#include "matching/projector.hpp"

namespace orbslam {
namespace {

constexpr double kFuseMonoGate = 5.99;         // chi-square, 95 %, 2 degrees of freedom
constexpr double kFuseStereoGate = 7.8;        // 3 degrees of freedom, rounded as in the original
constexpr std::size_t kSecondDegree = 5;       // neighbours of a neighbour that take part
constexpr std::size_t kRefreshedAtOnce = 200;  // points per write section, to keep it short
constexpr float kNeighbourRadius = 3.0F;       // pixels of the predicted level

// A keyframe as the search sees it, copied under the lock.
struct Target {
  KeyFrameId id;
  std::shared_ptr<const Frame> frame;
  Pose T_cw;
};

struct Fusion {
  std::size_t point;  // index in the batch
  std::uint32_t keypoint;
};

bool reprojection_agrees(const Frame& frame, std::size_t keypoint, const ImagePoint& image) {
  const Keypoint& feature = frame.keypoints[keypoint];
  const Eigen::Vector2d off =
      frame.camera->raw_error({image.u - feature.x, image.v - feature.y}, feature.x, feature.y);
  double error = off.squaredNorm();
  double gate = kFuseMonoGate;
  if (frame.has_depth(keypoint)) {
    // Disparities are not those of the lens.
    const double along = frame.camera->along_epipolar_curve(off, feature.x, feature.y);
    const double error_right =
        along + (image.right_u - image.u) - (frame.right_u[keypoint] - feature.x);
    error += error_right * error_right;
    gate = kFuseStereoGate;
  }
  return error * frame.scales->inverse_sigma2(feature.level) <= gate;
}

// The batch's points that are not `observed` in the target and match one of its keypoints, in the
// order of the batch.
void find_fusions(const PointBatch& points, const std::vector<std::uint8_t>& observed,
                  const Target& target, std::vector<Fusion>& fusions) {
  thread_local std::vector<std::uint32_t> candidates;
  const Frame& frame = *target.frame;
  const Projector projector(frame, target.T_cw);
  fusions.clear();
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (observed[i]) continue;
    ExpectedView view;
    if (!expect_in_keyframe(projector, frame, points, i, view)) continue;
    const auto& [image, level] = view;
    frame.grid.features_in_area(
        frame.keypoints, static_cast<float>(image.u), static_cast<float>(image.v),
        kNeighbourRadius * frame.scales->scale(level), level - 1, level, candidates);
    int best = kDescriptorLow + 1;
    std::uint32_t match = 0;
    for (const std::uint32_t candidate : candidates) {
      if (!reprojection_agrees(frame, candidate, image)) continue;
      const int difference = hamming_distance(points.descriptors[i], frame.descriptors[candidate]);
      if (difference < best) {
        best = difference;
        match = candidate;
      }
    }
    if (best <= kDescriptorLow) fusions.push_back({i, match});
  }
}

// Runs under the write lock, and changes only objects that still live and have not moved. Returns
// the number of changes.
int apply_fusions(Map& map, const Target& target, const PointBatch& points,
                  const std::vector<Fusion>& fusions) {
  const KeyFrame* keyframe = map.find(target.id);
  if (!stands_at(keyframe, target.T_cw)) return 0;
  int changes = 0;
  for (const Fusion& fusion : fusions) {
    const MapPointId id = points.ids[fusion.point];
    const MapPoint* point = map.find(id);
    if (!point || point->observation_of(target.id)) continue;
    const MapPoint* present = map.find(keyframe->map_points[fusion.keypoint]);
    if (!present) {
      map.add_observation(id, target.id, fusion.keypoint);
    } else if (present->observation_count > point->observation_count) {
      map.replace_point(id, present->id);
    } else {
      map.replace_point(present->id, id);
    }
    ++changes;
  }
  return changes;
}

// Searches and commits; the write lock is only taken when there is something to change.
int fuse_into(Map& map, std::uint64_t epoch, const Target& target, const PointBatch& points,
              const std::vector<std::uint8_t>& observed) {
  thread_local std::vector<Fusion> fusions;
  find_fusions(points, observed, target, fusions);
  if (fusions.empty()) return 0;
  const auto lock = map.write_lock();
  return map.epoch() == epoch ? apply_fusions(map, target, points, fusions) : 0;
}

// First and second degree neighbours, each once, without the keyframe itself.
std::vector<KeyFrameId> fusion_targets(const Map& map, KeyFrameId current, std::size_t n) {
  std::vector<KeyFrameId> targets;
  const auto add = [&](KeyFrameId id) {
    if (id == current || !map.find(id)) return;
    if (std::find(targets.begin(), targets.end(), id) == targets.end()) targets.push_back(id);
  };
  for (const KeyFrameId neighbour : map.best_neighbours(current, n)) {
    add(neighbour);
    for (const KeyFrameId second : map.best_neighbours(neighbour, kSecondDegree)) add(second);
  }
  return targets;
}

// Points of `current` into every target.
int fuse_forward(Map& map, std::uint64_t epoch, const std::vector<KeyFrameId>& targets,
                 const PointBatch& points) {
  thread_local PointIdIndex index;
  thread_local std::vector<MapPointId> slots;
  thread_local std::vector<std::uint8_t> observed;
  index.reset(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    index.insert(points.ids[i], static_cast<std::int32_t>(i));
  }
  int changes = 0;
  for (const KeyFrameId id : targets) {
    Target target{id, nullptr, Pose()};
    {
      const auto lock = map.read_lock();
      const KeyFrame* keyframe = map.find(id);
      if (!keyframe || map.epoch() != epoch) continue;
      target.frame = keyframe->frame;
      target.T_cw = keyframe->T_cw;
      slots = keyframe->map_points;
    }
    observed.assign(points.size(), 0);
    for (const MapPointId slot : slots) {
      const std::int32_t point = index.find(slot);
      if (point != PointIdIndex::kNone) observed[static_cast<std::size_t>(point)] = 1;
    }
    changes += fuse_into(map, epoch, target, points, observed);
  }
  return changes;
}

// Points of all targets, each once, into `current`.
int fuse_backward(Map& map, std::uint64_t epoch, const std::vector<KeyFrameId>& targets,
                  KeyFrameId current) {
  thread_local PointIdIndex collected;
  Target target{current, nullptr, Pose()};
  PointBatch points;
  {
    const auto lock = map.read_lock();
    const KeyFrame* keyframe = map.find(current);
    if (!keyframe || map.epoch() != epoch) return 0;
    target.frame = keyframe->frame;
    target.T_cw = keyframe->T_cw;
    collected.reset(keyframe->map_points.size());
    // What the keyframe observes itself counts as collected.
    for (const MapPointId slot : keyframe->map_points) {
      if (slot.valid()) collected.insert(slot, 0);
    }
    for (const KeyFrameId id : targets) {
      const KeyFrame* neighbour = map.find(id);
      if (!neighbour) continue;
      for (const MapPointId slot : neighbour->map_points) {
        if (!slot.valid() || !collected.insert(slot, 0)) continue;
        if (const MapPoint* point = map.find(slot)) points.push_back(*point);
      }
    }
  }
  const std::vector<std::uint8_t> observed(points.size(), 0);
  return fuse_into(map, epoch, target, points, observed);
}

// Descriptors, directions and scale ranges of the keyframe's points, then its connections.
void refresh(Map& map, std::uint64_t epoch, KeyFrameId id) {
  std::vector<MapPointId> points;
  {
    const auto lock = map.read_lock();
    const KeyFrame* keyframe = map.find(id);
    if (!keyframe || map.epoch() != epoch) return;
    points = keyframe->map_points;
  }
  points.erase(std::remove_if(points.begin(), points.end(), [](auto p) { return !p.valid(); }),
               points.end());
  for (std::size_t begin = 0; begin < points.size(); begin += kRefreshedAtOnce) {
    const auto lock = map.write_lock();
    if (map.epoch() != epoch) return;
    const std::size_t end = std::min(begin + kRefreshedAtOnce, points.size());
    for (std::size_t i = begin; i < end; ++i) {
      if (map.find(points[i])) map.update_point(points[i]);
    }
  }
  const auto lock = map.write_lock();
  if (map.epoch() == epoch && map.find(id)) map.update_connections(id);
}

}  // namespace

int fuse_points(Map& map, KeyFrameId keyframe, const std::vector<MapPointId>& points) {
  Target target{keyframe, nullptr, Pose()};
  PointBatch batch;
  std::uint64_t epoch = 0;
  {
    const auto lock = map.read_lock();
    const KeyFrame* found = map.find(keyframe);
    if (!found) return 0;
    epoch = map.epoch();
    target.frame = found->frame;
    target.T_cw = found->T_cw;
    for (const MapPointId id : points) {
      const MapPoint* point = map.find(id);
      if (point && !point->observation_of(keyframe)) batch.push_back(*point);
    }
  }
  const std::vector<std::uint8_t> observed(batch.size(), 0);
  return fuse_into(map, epoch, target, batch, observed);
}

int fuse_with_neighbours(Map& map, KeyFrameId current, std::size_t n_neighbours) {
  std::vector<KeyFrameId> targets;
  PointBatch points;
  std::uint64_t epoch = 0;
  {
    const auto lock = map.read_lock();
    const KeyFrame* keyframe = map.find(current);
    if (!keyframe) return 0;
    epoch = map.epoch();
    targets = fusion_targets(map, current, n_neighbours);
    for (const MapPointId id : keyframe->map_points) {
      if (const MapPoint* point = map.find(id)) points.push_back(*point);
    }
  }
  int changes = fuse_forward(map, epoch, targets, points);
  changes += fuse_backward(map, epoch, targets, current);
  refresh(map, epoch, current);
  return changes;
}

}  // namespace orbslam
