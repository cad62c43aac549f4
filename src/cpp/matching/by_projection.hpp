// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "frame/frame.hpp"
#include "map/local_map.hpp"

namespace orbslam {

inline constexpr int kDescriptorHigh = 100;  ///< most differing bits when geometry guides
inline constexpr int kDescriptorLow = 50;    ///< most differing bits otherwise

/// Spec 06, 2.4. `current` has a predicted pose; matches of the last frame's points are written
/// into its associations. Window: `radius` level-0 pixels times the keypoint's scale.
/// `use_depth`: the sensor sees depth, so moving forwards or backwards restricts the levels.
/// Returns the number of matched keypoints. No lock: positions come from the last frame's copies
/// (refresh_associations() beforehand), descriptors of points from `points`, which holds the last
/// frame's points; associations with other points count as dead and are skipped.
/// Throws StateError when a frame has no pose.
int match_last_frame(TrackedFrame& current, const TrackedFrame& last, const PointBatch& points,
                     float radius, bool use_depth);

/// What the frustum test says of a point in a frame (spec 05, section 8).
struct FrustumView {
  float u = 0, v = 0, right_u = 0;
  float view_cosine = 0;
  std::int32_t level = 0;
  bool visible = false;
};
/// Batched frustum test at the frame's pose; limit 60 degrees from the mean direction. One entry
/// per point. Throws StateError when the frame has no pose.
std::vector<FrustumView> project_into(const TrackedFrame& frame, const PointBatch& points);

inline constexpr double kFrontalCosine = 0.998;  ///< above: seen nearly as it was mapped
inline constexpr float kFrontalRadius = 2.5F;    ///< pixels of the predicted level
inline constexpr float kObliqueRadius = 4.0F;    ///< the same for all other views

/// Search radius around a projected point, in pixels of its predicted level: points seen nearly
/// as they were mapped are predicted better.
inline float viewing_radius(float view_cosine) {
  return static_cast<double>(view_cosine) > kFrontalCosine ? kFrontalRadius : kObliqueRadius;
}

struct LocalMapMatches {
  int n_matches = 0;                ///< keypoints newly associated
  std::vector<MapPointId> visible;  ///< points in view that were not associated before
};
/// Spec 08, 7.3 and 06, 2.6: searches the local points that the frame does not hold yet (and that
/// are not in `exclude`, ascending: the outliers thrown out earlier in this frame). Earlier points
/// of the batch have priority. Throws StateError when the frame has no pose.
LocalMapMatches match_local_map(TrackedFrame& frame, const PointBatch& local_points,
                                const std::vector<MapPointId>& exclude, float radius_factor);

/// Spec 06, 2.5 (relocalization): points of a keyframe that are not in `found` (ascending).
/// Returns the number of new associations, 0 for a dead keyframe. Takes the read lock while it
/// copies the points. Throws StateError when the frame has no pose.
int match_keyframe_by_projection(const Map& map, KeyFrameId keyframe, TrackedFrame& frame,
                                 const std::vector<MapPointId>& found, float radius_factor,
                                 int max_distance);

}  // namespace orbslam
