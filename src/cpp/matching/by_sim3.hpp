// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "base/similarity.hpp"
#include "map/map.hpp"
#include "map/point_batch.hpp"

namespace orbslam {

// Search radii of the three functions below, in pixels of the predicted level.
inline constexpr float kSimilarityRadius = 7.5F;
inline constexpr float kLoopRadius = 10.0F;
inline constexpr float kLoopFusionRadius = 4.0F;

/// Finds further matches between two keyframes whose similarity S_ab is roughly known. `matches`
/// holds per keypoint of `a` the matched point of `b`, or an invalid id. Points of each keyframe
/// are transformed and searched in the other image; a match must be found in both directions. A
/// point is searched within `radius_factor` pixels of its predicted level, on that level or the
/// next finer one; at most kDescriptorHigh bits differ. Distances are compared in the units of the
/// map in which the point's scale range was measured. Returns the number of new matches, 0 when a
/// keyframe is dead. Takes the read lock while it copies. Throws std::invalid_argument unless
/// `matches` has one entry per keypoint of `a`. See docs/method/loops.md#verification.
int match_by_similarity(const Map& map, KeyFrameId a, KeyFrameId b, const Similarity& S_ab,
                        std::vector<MapPointId>& matches, float radius_factor = kSimilarityRadius);

/// Projects points on the far side of a loop into a keyframe at its corrected place `S_cw`.
/// `matches` holds per keypoint the matched point or an invalid id; free keypoints are matched to
/// living points (each listed once) that are not in it. A point that the keyframe should show
/// (expect_in_keyframe()) takes the keypoint with the most similar descriptor, of which at most
/// kDescriptorLow bits differ, within `radius_factor` pixels of its predicted level, on that level
/// or the next finer one. Returns the number of new matches, 0 for a dead keyframe. Takes the read
/// lock while it copies. Throws std::invalid_argument unless `matches` has one entry per keypoint.
int match_loop_points(const Map& map, KeyFrameId keyframe, const Similarity& S_cw,
                      const std::vector<MapPointId>& points, std::vector<MapPointId>& matches,
                      float radius_factor = kLoopRadius);

/// A point of the map and the keypoint of a keyframe that shows it.
struct PointSighting {
  MapPointId point;
  std::uint32_t keypoint = 0;
};

/// The same search for a keyframe that is to be corrected. Keypoints may be occupied, and several
/// points may match one keypoint, because the matches show which points are the same. The result is
/// in the order of `points`. Takes no lock. See docs/method/loops.md#fusion-across-the-loop.
std::vector<PointSighting> find_loop_fusions(const Frame& frame, const Similarity& S_cw,
                                             const PointBatch& points,
                                             float radius_factor = kLoopFusionRadius);

}  // namespace orbslam
