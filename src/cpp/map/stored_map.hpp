// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "map/contents.hpp"

namespace orbslam {

/// A borrowed array of `size` rows.
template <class Row>
struct Column {
  const Row* data = nullptr;
  std::size_t size = 0;

  const Row& operator[](std::size_t i) const { return data[i]; }
};

/// The arrays of a stored map (MapContents as columns). Only their lengths are checked: columns of
/// one group are equally long, and `offsets` has one entry more. The keypoints, which are most of
/// it, may come in parts.
struct StoredMap {
  std::int64_t next_keyframe = 0, next_point = 0;
  std::vector<CameraContents> cameras;
  struct {
    Column<std::int64_t> ids, frame_ids, camera, parent, offsets;
    Column<double> timestamps, scale;
    Column<Quaternion> rotations;
    Column<Vector3> translations;
    Column<std::uint8_t> provisional_parent, processed, has_colours;
  } keyframes;
  std::size_t n_keypoints = 0;
  struct {
    Column<std::int64_t> ids, parent;
    Column<Quaternion> rotations;
    Column<Vector3> translations;
    Column<double> scale, parent_scale;
  } removed_keyframes;
  struct {
    Column<std::int64_t> ids, reference_keyframe, first_keyframe, first_frame;
    Column<Vector3> positions, mean_directions;
    Column<double> min_distance, max_distance;
    const std::uint8_t* descriptors = nullptr;  ///< (p, 32)
    Column<std::int32_t> n_visible, n_found;
  } points;
  struct {
    Column<std::int64_t> point, keyframe;
    Column<std::int32_t> keypoint;
  } observations;
  struct {
    Column<std::int64_t> a, b;
    Column<std::int32_t> weight;
  } covisibility;
  Column<std::array<std::int64_t, 2>> loop_edges;
  struct {
    Column<std::int64_t> point, keyframe, camera;
    Column<std::uint8_t> level;
    Column<std::array<float, 2>> pixel, fraction;
    const std::uint16_t* values = nullptr;  ///< (q, ReferencePatch::kSize ^ 2)
  } patches;
  struct {
    Column<std::int64_t> keyframe, point;
    Column<std::int32_t> keypoint;
    Column<std::array<float, 2>> position;
    Column<float> right_u, variance, right_variance;
    Column<std::uint8_t> reference;
  } aligned;
  Column<NoiseRow> noise;
};

/// The keypoints of the keyframes in the rows first_row .. end_row - 1.
struct StoredKeypoints {
  std::size_t first_row = 0, end_row = 0;
  ReadableKeypoints columns;  ///< as many as these keyframes' offsets say
};

/// Checks everything that restore_map() relies on, except the keypoints, before memory is
/// allocated. Ids ascend and refer to existing objects, counts and sizes agree, poses are rigid,
/// numbers are finite and in range, and the spanning tree is a tree. Throws MapFileError with one
/// clause that names the thing.
void check_stored_map(const StoredMap& stored);
/// The same for the keypoints of a map that has passed check_stored_map().
void check_stored_keypoints(const StoredMap& stored, const StoredKeypoints& keypoints);

/// The frame of keyframe `row`, one of those whose keypoints are given; not described yet.
std::shared_ptr<Frame> restore_frame(
    const StoredMap& stored, const StoredKeypoints& keypoints, std::size_t row,
    const std::vector<std::shared_ptr<const Camera>>& cameras,
    const std::vector<std::shared_ptr<const ScalePyramid>>& scales);

/// The cameras and pyramids of restore_frame(). Throws MapFileError for impossible ones.
std::vector<std::shared_ptr<const Camera>> restore_cameras(const StoredMap& stored);
std::vector<std::shared_ptr<const ScalePyramid>> restore_scales(const StoredMap& stored);

/// Fills an empty map; `frames` has one frame a keyframe. Takes the write lock. Throws StateError
/// when the map is not empty. See docs/reference/map_file.md.
void restore_map(Map& map, const StoredMap& stored,
                 const std::vector<std::shared_ptr<const Frame>>& frames);

}  // namespace orbslam
