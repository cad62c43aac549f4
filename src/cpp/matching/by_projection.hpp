// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "frame/frame.hpp"
#include "map/local_map.hpp"

namespace orbslam {

inline constexpr int kDescriptorHigh = 100;  ///< most differing bits in a search window
inline constexpr int kDescriptorLow = 50;    ///< most differing bits otherwise

/// Matches the points of the last frame, outliers excepted, to keypoints of `current`, whose pose
/// is predicted, and writes the matches into its associations (Mur-Artal et al. 2015, section V-B).
/// A projected point takes the keypoint with the most similar descriptor, of which at most
/// kDescriptorHigh bits differ, in a window of `radius` level-0 pixels times the scale of the last
/// keypoint, on its level or a neighbouring one. `use_depth`: the sensor sees depth, so after
/// moving forwards by more than the baseline only this and coarser levels are searched, after
/// moving backwards only this and finer ones. Keypoints that hold a point of the map are not taken;
/// those with depth must agree in the right image too. Matches whose rotation disagrees with the
/// majority are dropped in the end (OrientationHistogram).
///
/// Returns the number of matched keypoints. No lock: positions come from the last frame's copies
/// (refresh_associations() beforehand), descriptors of points from `points`, which holds the last
/// frame's points; associations with other points count as dead and are skipped.
/// Throws StateError when a frame has no pose. See docs/method/tracking.md#motion-model.
int match_last_frame(TrackedFrame& current, const TrackedFrame& last, const PointBatch& points,
                     float radius, bool use_depth);

/// Result of the frustum test of a point in a frame; all zero when it is not visible.
struct FrustumView {
  float u = 0, v = 0, right_u = 0;  ///< its pixel, and the column in the (virtual) right image
  float view_cosine = 0;            ///< between this view and the point's mean direction
  std::int32_t level = 0;           ///< of the pyramid, predicted from the distance
  bool visible = false;
};
/// Frustum test of all points at the frame's pose, one entry per point. A point is visible when it
/// is in front of the camera, its pixel is inside the image bounds, its distance is in its scale
/// range (in_scale_range()) and it is seen at most 60 degrees from its mean direction. No lock.
/// Throws StateError when the frame has no pose.
std::vector<FrustumView> project_into(const TrackedFrame& frame, const PointBatch& points);

inline constexpr double kFrontalCosine = 0.998;  ///< above: close to the mean direction
inline constexpr float kFrontalRadius = 2.5F;    ///< pixels of the predicted level
inline constexpr float kObliqueRadius = 4.0F;    ///< the same for all other views

/// Search radius around a projected point, in pixels of its predicted level. It is smaller for a
/// viewing direction close to the mean one, because the prediction is better.
inline float viewing_radius(float view_cosine) {
  return static_cast<double>(view_cosine) > kFrontalCosine ? kFrontalRadius : kObliqueRadius;
}

struct LocalMapMatches {
  int n_matches = 0;                ///< keypoints newly associated
  std::vector<MapPointId> visible;  ///< points in view that were not associated before
};
/// Searches the frame for the local points that it does not hold yet and that are not in `exclude`
/// (the outliers thrown out earlier in this frame), and associates what it finds (Mur-Artal et al.
/// 2015, section V-D). A visible point is searched within viewing_radius() times `radius_factor`
/// pixels of its predicted level, on that level or the next finer one, among keypoints that hold no
/// point of the map and, where they have depth, agree in the right image. It takes the one with the
/// most similar descriptor unless more than kDescriptorHigh bits differ, or the second best is on
/// the same level and nearly as similar (ratio 0.8). Earlier points of the batch have priority. No
/// lock. Throws StateError when the frame has no pose. See
/// docs/method/tracking.md#matching-the-local-map.
LocalMapMatches match_local_map(TrackedFrame& frame, const PointBatch& local_points,
                                const std::vector<MapPointId>& exclude, float radius_factor);

/// Searches a frame whose pose is roughly known for the points of a keyframe that are not in
/// `found` (ascending): further matches of a relocalization. A point in front of the camera, inside
/// the image and in its scale range takes the free keypoint with the most similar descriptor, of
/// which at most `max_distance` bits differ, within `radius_factor` pixels of its predicted level,
/// on that level or a neighbouring one. Matches whose rotation disagrees with the majority are
/// dropped in the end. Returns the number of new associations, 0 for a dead keyframe. Takes the
/// read lock while it copies the points. Throws StateError when the frame has no pose or `found` is
/// not ascending. See docs/method/relocalization.md#widening.
int match_keyframe_by_projection(const Map& map, KeyFrameId keyframe, TrackedFrame& frame,
                                 const std::vector<MapPointId>& found, float radius_factor,
                                 int max_distance);

}  // namespace orbslam
