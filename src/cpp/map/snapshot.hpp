// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <vector>

#include "map/map.hpp"

namespace orbslam {

/// Row-major 4x4 matrix, as NumPy lays it out.
using Matrix4 = std::array<double, 16>;
/// The homogeneous matrix of a pose.
Matrix4 row_major(const Pose& pose);

/// Published keyframes by ascending id.
struct KeyFrameSnapshot {
  std::vector<KeyFrameId> ids;
  std::vector<Matrix4> T_wc;        ///< camera to world
  std::vector<double> timestamps;   ///< seconds
  std::vector<KeyFrameId> parents;  ///< spanning tree; invalid for the root
};

/// Covisibility edges a[i] < b[i], by ascending (a, b).
struct EdgeSnapshot {
  std::vector<KeyFrameId> a, b;
  std::vector<std::int32_t> weights;  ///< shared points
};

/// Points by ascending id.
struct PointSnapshot {
  std::vector<MapPointId> ids;
  std::vector<std::array<double, 3>> positions;  ///< world
  std::vector<std::int32_t> observation_counts;  ///< weighted: 2 with depth, else 1
};

/// Observations: those of ids[i] are entries offsets[i] .. offsets[i + 1] - 1, by ascending
/// keyframe.
struct ObservationSnapshot {
  std::vector<MapPointId> ids;
  std::vector<std::int64_t> offsets;  ///< ids.size() + 1 entries
  std::vector<KeyFrameId> keyframes;
  std::vector<std::int32_t> keypoints;  ///< index of the keypoint in its keyframe
};

/// Keyframes, loop edges a[i] < b[i] by ascending (a, b), and points, all of one moment.
struct MapSnapshot {
  KeyFrameSnapshot keyframes;
  std::vector<KeyFrameId> loop_a, loop_b;
  PointSnapshot points;
};

// Copies for viewers, exporters and users; each is one consistent view and takes the read lock. See
// docs/method/map.md#keyframes. They are of one map, whose world the poses and positions are in:
// `which`, or the active one if that is kNoMap.

/// The published keyframes.
KeyFrameSnapshot snapshot_keyframes(const Map& map, MapIndex which = kNoMap);
/// Edges between published keyframes with weight >= min_weight.
EdgeSnapshot snapshot_edges(const Map& map, int min_weight = Map::kCovisibilityThreshold,
                            MapIndex which = kNoMap);
/// The observations of the points, those by unpublished keyframes included.
ObservationSnapshot snapshot_observations(const Map& map, MapIndex which = kNoMap);
/// Keyframes, loop edges and points together.
MapSnapshot snapshot_map(const Map& map, MapIndex which = kNoMap);

}  // namespace orbslam
