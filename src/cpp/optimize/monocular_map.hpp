// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "frame/frame.hpp"
#include "map/map.hpp"
#include "optimize/bundle_adjustment.hpp"

namespace orbslam {

/// Points that the first map of a single camera must have at least.
inline constexpr std::size_t kFewestInitialPoints = 100;

enum class MonocularMapFailure {
  kNone,
  kFewPoints,   ///< fewer than `min_points` points in the second keyframe
  kBadDepth,    ///< the median depth is not a positive number
  kMapCleared,  ///< the map was cleared in between
};

struct MonocularMap {
  bool ok = false;
  MonocularMapFailure failure = MonocularMapFailure::kNone;
  KeyFrameId first, second;  ///< of the active map
  int n_points = 0;          ///< points of the second keyframe
  /// Median depth in the first keyframe before it was scaled to 1, in units of |t_21|; NaN without
  /// points.
  double median_depth = std::numeric_limits<double>::quiet_NaN();
  BundleSummary summary;  ///< of the bundle adjustment
};

/// Makes the first map of a single camera from two frames whose relative pose is known up to scale
/// (Mur-Artal et al. 2015, section IV). Keyframe 0 (the world's frame) and 1 are made, the matched
/// points are added with both observations, everything is refined by full bundle adjustment (20
/// iterations, robust), and the map is scaled so that the median depth in the first keyframe is 1.
/// Both keyframes are connected and published at the end, in one section with the scaling. Other
/// threads do not see the map before. Local mapping takes them both, in order, afterwards; the
/// points then enter its list of recent points with the second.
///
/// `matches`: per keypoint of `initial` its partner in `current` or -1. `points`: per keypoint of
/// `initial` its position in the frame of the initial camera, read where matched; matches whose
/// point is not finite are left out. `T_21` maps the initial camera's frame to the current one's.
///
/// On success both frames have the final pose, associations with all points and their keyframe as
/// reference. On failure they are unchanged, and the keyframes and points made stay in the map,
/// unpublished: the caller must clear it. Throws StateError when the map is not empty, a frame is
/// not described, or the lists do not fit the frames (sizes, indices, one-to-one). Takes the write
/// lock twice, not while it refines. See docs/method/start.md#the-first-map.
MonocularMap create_monocular_map(Map& map, TrackedFrame& initial, TrackedFrame& current,
                                  const Pose& T_21, const std::vector<int>& matches,
                                  const std::vector<Eigen::Vector3d>& points,
                                  std::size_t min_points = kFewestInitialPoints);

}  // namespace orbslam
