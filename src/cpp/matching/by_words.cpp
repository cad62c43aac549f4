// SPDX-License-Identifier: BSD-3-Clause
#include "matching/by_words.hpp"

#include <algorithm>
#include <memory>

#include "matching/by_projection.hpp"
#include "matching/common_nodes.hpp"
#include "matching/orientation_consistency.hpp"

namespace orbslam {
namespace {

constexpr int kFarthest = 256;

// The data of a keyframe for a search, copied so that the search runs without the lock.
struct KeyFrameFeatures {
  std::shared_ptr<const Frame> frame;  // none: the keyframe is dead
  std::vector<MapPointId> points;      // living ones per keypoint, else invalid
  std::vector<Eigen::Vector3d> positions;
};

void gather(const Map& map, KeyFrameId id, bool with_positions, KeyFrameFeatures& features) {
  const KeyFrame* keyframe = map.find(id);
  if (!keyframe) return;
  features.frame = keyframe->frame;
  features.points = keyframe->map_points;
  if (with_positions) features.positions.resize(features.points.size());
  for (std::size_t i = 0; i < features.points.size(); ++i) {
    if (!features.points[i].valid()) continue;
    const MapPoint* point = map.find(features.points[i]);
    if (!point) {
      features.points[i] = MapPointId();
    } else if (with_positions) {
      features.positions[i] = point->position;
    }
  }
}

// The loop over features that both searches share. `usable_b(j)` says which features of b compete,
// `pairs` receives (feature of a, feature of b) in node order.
template <class UsableB>
void match_nodes(const KeyFrameFeatures& a, const Frame& frame_b, float ratio, UsableB&& usable_b,
                 std::vector<std::pair<std::uint32_t, std::uint32_t>>& pairs) {
  const Frame& frame_a = *a.frame;
  thread_local std::vector<std::uint8_t> used_b;
  used_b.assign(frame_b.size(), 0);
  pairs.clear();
  for_each_common_node(frame_a, frame_b, [&](NodeFeatures node_a, NodeFeatures node_b) {
    for (const std::uint32_t i : node_a) {
      if (!a.points[i].valid()) continue;
      int best = kFarthest, second = kFarthest;
      std::uint32_t match = 0;
      for (const std::uint32_t j : node_b) {
        if (used_b[j] || !usable_b(j)) continue;
        const int distance = hamming_distance(frame_a.descriptors[i], frame_b.descriptors[j]);
        if (distance < best) {
          second = best;
          best = distance;
          match = j;
        } else if (distance < second) {
          second = distance;
        }
      }
      if (best > kDescriptorLow || static_cast<float>(best) >= ratio * static_cast<float>(second)) {
        continue;
      }
      used_b[match] = 1;
      pairs.emplace_back(i, match);
    }
  });
}

// Of one feature: the feature of the other side that is most alike, the first of equals, and by how
// many bits it and the second best differ.
struct Nearest {
  std::uint32_t match = 0;
  int best = kFarthest, second = kFarthest;

  void offer(std::uint32_t other, int distance) {
    if (distance < best) {
      second = best;
      best = distance;
      match = other;
    } else if (distance < second) {
      second = distance;
    }
  }
};

// Pairs that are most alike on both sides: every feature of a with a point against all of b.
void match_all(const KeyFrameFeatures& a, const Frame& frame_b, float ratio,
               std::vector<std::pair<std::uint32_t, std::uint32_t>>& pairs) {
  const Frame& frame_a = *a.frame;
  thread_local std::vector<Nearest> of_a, of_b;
  of_a.assign(frame_a.size(), {});
  of_b.assign(frame_b.size(), {});
  const auto n_a = static_cast<std::uint32_t>(frame_a.size());
  const auto n_b = static_cast<std::uint32_t>(frame_b.size());
  for (std::uint32_t i = 0; i < n_a; ++i) {
    if (!a.points[i].valid()) continue;
    for (std::uint32_t j = 0; j < n_b; ++j) {
      const int distance = hamming_distance(frame_a.descriptors[i], frame_b.descriptors[j]);
      of_a[i].offer(j, distance);
      of_b[j].offer(i, distance);
    }
  }
  pairs.clear();
  for (std::uint32_t i = 0; i < n_a; ++i) {
    const Nearest& nearest = of_a[i];
    const bool alike =
        nearest.best <= kDescriptorUnguided &&
        static_cast<float>(nearest.best) < ratio * static_cast<float>(nearest.second);
    if (alike && of_b[nearest.match].match == i) pairs.emplace_back(i, nearest.match);
  }
}

// Drops the pairs whose rotation disagrees with the majority and sorts the rest by feature of a.
void keep_consistent(const Frame& frame_a, const Frame& frame_b,
                     std::vector<std::pair<std::uint32_t, std::uint32_t>>& pairs) {
  thread_local OrientationHistogram rotations;
  rotations.clear();
  std::sort(pairs.begin(), pairs.end());
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    rotations.add(static_cast<std::uint32_t>(k), frame_a.keypoints[pairs[k].first].angle,
                  frame_b.keypoints[pairs[k].second].angle);
  }
  thread_local std::vector<std::uint8_t> drop;
  drop.assign(pairs.size(), 0);
  for (const std::uint32_t k : rotations.inconsistent()) drop[k] = 1;
  std::size_t kept = 0;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    if (!drop[k]) pairs[kept++] = pairs[k];
  }
  pairs.resize(kept);
}

// Associates a frame with the points of a keyframe: `match(features of the keyframe, pairs)` fills
// the pairs.
template <class Match>
int match_keyframe(const Map& map, KeyFrameId keyframe, TrackedFrame& frame, Match&& match) {
  KeyFrameFeatures features;
  {
    const auto lock = map.read_lock();
    gather(map, keyframe, true, features);
  }
  frame.clear_associations();
  if (!features.frame) return 0;

  thread_local std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
  match(features, pairs);
  keep_consistent(*features.frame, *frame.frame, pairs);
  for (const auto& [i, j] : pairs) {
    frame.associate(j, features.points[i], features.positions[i]);
  }
  return static_cast<int>(pairs.size());
}

}  // namespace

int match_keyframe_by_words(const Map& map, KeyFrameId keyframe, TrackedFrame& frame, float ratio) {
  return match_keyframe(map, keyframe, frame, [&](const KeyFrameFeatures& features, auto& pairs) {
    match_nodes(
        features, *frame.frame, ratio, [](std::uint32_t) { return true; }, pairs);
  });
}

int match_keyframe_by_descriptors(const Map& map, KeyFrameId keyframe, TrackedFrame& frame,
                                  float ratio) {
  return match_keyframe(map, keyframe, frame, [&](const KeyFrameFeatures& features, auto& pairs) {
    match_all(features, *frame.frame, ratio, pairs);
  });
}

std::vector<std::pair<std::uint32_t, std::uint32_t>> match_keyframes_by_words(const Map& map,
                                                                              KeyFrameId a,
                                                                              KeyFrameId b,
                                                                              float ratio) {
  KeyFrameFeatures features_a, features_b;
  {
    const auto lock = map.read_lock();
    gather(map, a, false, features_a);
    gather(map, b, false, features_b);
  }
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
  if (!features_a.frame || !features_b.frame) return pairs;

  const auto usable_b = [&](std::uint32_t j) { return features_b.points[j].valid(); };
  match_nodes(features_a, *features_b.frame, ratio, usable_b, pairs);
  keep_consistent(*features_a.frame, *features_b.frame, pairs);
  return pairs;
}

}  // namespace orbslam
