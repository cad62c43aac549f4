// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "map/map.hpp"

namespace orbslam {

/// A camera, and the image pyramid used with it.
struct CameraContents {
  CameraOptions camera;
  float scale_factor = 0;
  int n_levels = 0;
};

using Quaternion = std::array<double, 4>;  ///< x, y, z, w
using Vector3 = std::array<double, 3>;

/// A keyframe without its keypoints.
struct KeyFrameRows {
  std::vector<KeyFrameId> ids;
  std::vector<FrameId> frame_ids;
  std::vector<double> timestamps;
  std::vector<std::int64_t> camera;  ///< rows of MapContents::cameras
  std::vector<Quaternion> rotations;
  std::vector<Vector3> translations;
  std::vector<double> scale;
  std::vector<KeyFrameId> parent;
  std::vector<std::uint8_t> provisional_parent, processed;
};

struct RemovedKeyFrameRows {
  std::vector<KeyFrameId> ids, parent;
  std::vector<Quaternion> rotations;  ///< of T_kp
  std::vector<Vector3> translations;
  std::vector<double> scale, parent_scale;
};

struct PointRows {
  std::vector<MapPointId> ids;
  std::vector<Vector3> positions, mean_directions;
  std::vector<double> min_distance, max_distance;
  std::vector<Descriptor> descriptors;
  std::vector<std::int32_t> n_visible, n_found;
  std::vector<KeyFrameId> reference_keyframe, first_keyframe;
  std::vector<FrameId> first_frame;
};

struct ObservationRows {
  std::vector<MapPointId> point;
  std::vector<KeyFrameId> keyframe;
  std::vector<std::int32_t> keypoint;
};

struct EdgeRows {
  std::vector<KeyFrameId> a, b;
  std::vector<std::int32_t> weight;
};

/// The reference sightings of points, whose camera is known by its row.
struct PatchRows {
  std::vector<MapPointId> point;     ///< ascending
  std::vector<std::int64_t> camera;  ///< rows of MapContents::cameras
  std::vector<std::shared_ptr<const PointPatch>> patches;
};

/// Sightings that count, or that alignment failed at, of the keyframes that may have changed.
struct AlignedRows {
  std::vector<KeyFrameId> keyframe;  ///< ascending, and then by keypoint
  std::vector<std::int32_t> keypoint;
  std::vector<AlignedSighting> sightings;
};

/// NoiseFactor: its value and how often it was measured.
using NoiseRow = std::array<double, 2>;

/// The complete contents of a map at one moment, ordered by id. Keyframes that local mapping has
/// not processed yet are left out, and so are points that only they observe. See
/// docs/reference/map_file.md.
struct MapContents {
  std::uint64_t epoch = 0;
  std::uint64_t keyframe_stamp = 0, point_stamp = 0;  ///< of the last changes (IdTable::stamp)
  std::vector<std::uint8_t> keyframe_changed;  ///< one a keyframe: later than the stamp given
  std::vector<std::int64_t> pages;             ///< of points (IdTable) that were looked at
  /// Of these, the points with observations that were left out. Such an observation may enter the
  /// contents without a change of the point.
  std::vector<std::int64_t> incomplete_pages;
  KeyFrameId next_keyframe;
  MapPointId next_point;
  std::vector<CameraContents> cameras;
  KeyFrameRows keyframes;
  std::vector<std::shared_ptr<const Frame>> frames;  ///< one per keyframe: the constant data
  RemovedKeyFrameRows removed_keyframes;
  PointRows points;
  ObservationRows observations;
  EdgeRows covisibility;
  std::vector<std::array<KeyFrameId, 2>> loop_edges;
  PatchRows patches;
  AlignedRows aligned;
  std::vector<NoiseRow> noise;  ///< of positions and of right columns; empty: nothing is aligned
};

/// The state of an earlier copy of the same map, by its stamps.
struct ContentsKnown {
  std::uint64_t keyframe_stamp = 0, point_stamp = 0;
  std::vector<std::int64_t> incomplete_pages;
};

/// Copies the map. Of the points only those on pages with a change since `known`, or incomplete
/// then. Takes the read lock; the frames' keypoints are not copied under it. Without patches there
/// are no aligned sightings either.
MapContents take_contents(const Map& map, const ContentsKnown& known = {},
                          bool with_patches = true);

/// The keypoints of many frames, one after the other, borrowed for reading or writing. Colours,
/// raw positions and words may be null.
template <class Float, class Byte, class Word>
struct KeypointColumns {
  Float* keypoints = nullptr;      ///< (n, 2)
  Float* raw_keypoints = nullptr;  ///< (n, 2)
  Byte* octave = nullptr;
  Float* angle = nullptr;
  Float* response = nullptr;
  Byte* descriptors = nullptr;  ///< (n, 32)
  Float* depth = nullptr;
  Float* right_u = nullptr;
  Byte* colours = nullptr;  ///< (n, 3)
  Word* words = nullptr;    ///< kNoWord where the word is stopped
};
using WritableKeypoints = KeypointColumns<float, std::uint8_t, std::uint32_t>;
using ReadableKeypoints = KeypointColumns<const float, const std::uint8_t, const std::uint32_t>;

/// Writes the keypoints of a frame into the columns, from row `first` on. Words are written of a
/// frame that is described only.
void copy_keypoints(const Frame& frame, const WritableKeypoints& into, std::size_t first);

}  // namespace orbslam
