// SPDX-License-Identifier: BSD-3-Clause
#include "map/contents.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "map/contents_access.hpp"

namespace orbslam {
namespace {

Quaternion quaternion_of(const Pose& pose) {
  const Eigen::Quaterniond& q = pose.rotation();
  return {q.x(), q.y(), q.z(), q.w()};
}

Vector3 row_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

bool is_published(const Map& map, KeyFrameId id) {
  const KeyFrame* keyframe = map.find(id);
  return keyframe && keyframe->published;
}

bool same_model(const CameraModel* a, const CameraModel* b) {
  return a == nullptr || b == nullptr ? a == b : *a == *b;
}

bool same(const CameraContents& known, const Frame& frame) {
  const CameraOptions& a = known.camera;
  const CameraOptions& b = frame.camera->options();
  return a.pinhole.fx == b.pinhole.fx && a.pinhole.fy == b.pinhole.fy &&
         a.pinhole.cx == b.pinhole.cx && a.pinhole.cy == b.pinhole.cy &&
         a.distortion == b.distortion && a.bf == b.bf && a.depth_ratio == b.depth_ratio &&
         a.image_size.width == b.image_size.width && a.image_size.height == b.image_size.height &&
         same_model(a.model.get(), b.model.get()) && a.right_centre == b.right_centre &&
         known.scale_factor == frame.scales->factor() && known.n_levels == frame.scales->levels();
}

/// The frames' cameras, each once, in the order in which they first appear.
void list_cameras(MapContents& contents) {
  auto& cameras = contents.cameras;
  const Frame* before = nullptr;
  std::int64_t row = 0;
  for (const auto& frame : contents.frames) {
    const bool known = before && before->camera == frame->camera && before->scales == frame->scales;
    if (!known) {
      const auto found = std::find_if(cameras.begin(), cameras.end(),
                                      [&](const CameraContents& c) { return same(c, *frame); });
      row = found - cameras.begin();
      if (found == cameras.end()) {
        cameras.push_back(
            {frame->camera->options(), frame->scales->factor(), frame->scales->levels()});
      }
    }
    before = frame.get();
    contents.keyframes.camera.push_back(row);
  }
}

/// The nearest ancestor in the spanning tree that is part of the contents.
KeyFrameId published_parent(const Map& map, const KeyFrame& keyframe) {
  KeyFrameId parent = keyframe.parent;
  while (parent.valid() && !is_published(map, parent)) parent = map.find(parent)->parent;
  return parent.valid() || map.is_root(keyframe) ? parent : map.root(keyframe.map);
}

void copy_keyframes(const Map& map, MapContents& contents) {
  KeyFrameRows& rows = contents.keyframes;
  EdgeRows& edges = contents.covisibility;
  map.for_each_keyframe([&](const KeyFrame& keyframe) {
    if (!keyframe.published) return;
    contents.frames.push_back(keyframe.frame);
    rows.ids.push_back(keyframe.id);
    rows.frame_ids.push_back(keyframe.frame->id);
    rows.timestamps.push_back(keyframe.frame->timestamp);
    rows.rotations.push_back(quaternion_of(keyframe.T_cw));
    rows.translations.push_back(row_of(keyframe.T_cw.translation()));
    rows.scale.push_back(keyframe.scale);
    rows.parent.push_back(published_parent(map, keyframe));
    rows.provisional_parent.push_back(keyframe.provisional_parent ? 1 : 0);
    rows.processed.push_back(keyframe.processed ? 1 : 0);
    for (auto it = keyframe.weights.upper_bound(keyframe.id); it != keyframe.weights.end(); ++it) {
      if (!is_published(map, it->first)) continue;
      edges.a.push_back(keyframe.id);
      edges.b.push_back(it->first);
      edges.weight.push_back(it->second);
    }
    for (const KeyFrameId other : keyframe.loop_edges) {
      if (other > keyframe.id && is_published(map, other))
        contents.loop_edges.push_back({keyframe.id, other});
    }
  });
}

void reserve(PointRows& rows, ObservationRows& observations, std::size_t n) {
  rows.ids.reserve(n);
  rows.positions.reserve(n);
  rows.mean_directions.reserve(n);
  rows.min_distance.reserve(n);
  rows.max_distance.reserve(n);
  rows.descriptors.reserve(n);
  rows.n_visible.reserve(n);
  rows.n_found.reserve(n);
  rows.reference_keyframe.reserve(n);
  rows.first_keyframe.reserve(n);
  rows.first_frame.reserve(n);
  observations.point.reserve(4 * n);
  observations.keyframe.reserve(4 * n);
  observations.keypoint.reserve(4 * n);
}

/// A patch is of use with the pose of its keyframe only.
void copy_patch(const Map& map, const MapPoint& point, PatchRows& rows) {
  if (!point.patch) return;
  const KeyFrameId keyframe = point.patch->keyframe;
  if (!is_published(map, keyframe) && !MapContentsAccess::is_archived(map, keyframe)) return;
  rows.point.push_back(point.id);
  rows.patches.push_back(point.patch);
}

/// Records the point. Returns whether all its observations are part of the contents.
bool copy_point(const Map& map, const MapPoint& point, MapContents& contents) {
  PointRows& rows = contents.points;
  ObservationRows& observations = contents.observations;
  KeyFrameId reference;
  bool complete = true;
  for (const Observation& observation : point.observations) {
    if (!is_published(map, observation.keyframe)) {
      complete = false;
      continue;
    }
    observations.point.push_back(point.id);
    observations.keyframe.push_back(observation.keyframe);
    observations.keypoint.push_back(static_cast<std::int32_t>(observation.index));
    if (!reference.valid() || observation.keyframe == point.reference_keyframe) {
      reference = observation.keyframe;
    }
  }
  if (!reference.valid()) return complete;
  rows.ids.push_back(point.id);
  rows.positions.push_back(row_of(point.position));
  rows.mean_directions.push_back(row_of(point.mean_direction));
  rows.min_distance.push_back(point.min_distance);
  rows.max_distance.push_back(point.max_distance);
  rows.descriptors.push_back(point.descriptor);
  rows.n_visible.push_back(point.n_visible.value());
  rows.n_found.push_back(point.n_found.value());
  rows.reference_keyframe.push_back(reference);
  rows.first_keyframe.push_back(point.first_keyframe);
  rows.first_frame.push_back(point.first_frame);
  return complete;
}

void copy_points(const Map& map, const ContentsKnown& known, bool with_patches,
                 MapContents& contents) {
  const auto& table = map.point_table();
  if (known.point_stamp == 0) reserve(contents.points, contents.observations, map.n_points());
  contents.point_stamp = table.stamp();
  for (std::size_t page = 0; page < table.n_pages(); ++page) {
    const auto number = static_cast<std::int64_t>(page);
    if (table.page_stamp(page) <= known.point_stamp &&
        !std::binary_search(known.incomplete_pages.begin(), known.incomplete_pages.end(), number)) {
      continue;
    }
    bool complete = true;
    table.for_each_change(page, 0, [&](MapPointId, const MapPoint* point) {
      if (!point) return;
      const std::size_t before = contents.points.ids.size();
      complete &= copy_point(map, *point, contents);
      const bool is_part = contents.points.ids.size() > before;
      if (with_patches && is_part) copy_patch(map, *point, contents.patches);
    });
    contents.pages.push_back(number);
    if (!complete) contents.incomplete_pages.push_back(number);
  }
}

void copy_aligned(const Map& map, std::uint64_t since, AlignedRows& rows) {
  const auto& table = map.keyframe_table();
  for (std::size_t page = 0; page < table.n_pages(); ++page) {
    table.for_each_change(page, since, [&](KeyFrameId id, const KeyFrame* keyframe) {
      if (!keyframe || !keyframe->published) return;
      for (std::size_t i = 0; i < keyframe->aligned.size(); ++i) {
        const AlignedSighting& sighting = keyframe->aligned[i];
        if (!sighting.point.valid() || keyframe->map_points[i] != sighting.point) continue;
        const MapPoint* point = map.find(sighting.point);
        if (!point || !point->patch) continue;
        rows.keyframe.push_back(id);
        rows.keypoint.push_back(static_cast<std::int32_t>(i));
        rows.sightings.push_back(sighting);
      }
    });
  }
}

NoiseRow row_of(const NoiseFactor& noise) {
  return {noise.value(), static_cast<double>(noise.n_measured())};
}

/// Leaves out patches whose camera no keyframe has any more.
void list_cameras_of_patches(MapContents& contents) {
  PatchRows kept;
  const PointPatch* before = nullptr;
  std::int64_t row = -1;
  for (std::size_t i = 0; i < contents.patches.point.size(); ++i) {
    auto& patch = contents.patches.patches[i];
    if (!before || before->camera != patch->camera || before->scales != patch->scales) {
      Frame seen;
      seen.camera = patch->camera;
      seen.scales = patch->scales;
      const auto found =
          std::find_if(contents.cameras.begin(), contents.cameras.end(),
                       [&](const CameraContents& camera) { return same(camera, seen); });
      row = found == contents.cameras.end() ? -1 : found - contents.cameras.begin();
    }
    before = patch.get();
    if (row < 0) continue;
    kept.point.push_back(contents.patches.point[i]);
    kept.camera.push_back(row);
    kept.patches.push_back(patch);
  }
  contents.patches = std::move(kept);
}

void note_changed_keyframes(const Map& map, std::uint64_t since, MapContents& contents) {
  const auto& table = map.keyframe_table();
  contents.keyframe_stamp = table.stamp();
  std::vector<KeyFrameId> changed;
  for (std::size_t page = 0; page < table.n_pages(); ++page) {
    table.for_each_change(page, since, [&](KeyFrameId id, const KeyFrame* keyframe) {
      if (keyframe) changed.push_back(id);
    });
  }
  for (const KeyFrameId id : contents.keyframes.ids) {
    contents.keyframe_changed.push_back(std::binary_search(changed.begin(), changed.end(), id) ? 1
                                                                                               : 0);
  }
}

void copy_removed(const Map& map, MapContents& contents) {
  const auto archive = MapContentsAccess::archived(map);
  RemovedKeyFrameRows& rows = contents.removed_keyframes;
  for (const auto& removed : archive) {
    const bool hangs_on_unpublished =
        map.find(removed.parent) && !is_published(map, removed.parent);
    const ArchivedPose& kept =
        hangs_on_unpublished ? MapContentsAccess::relative_to_root(map, removed.id) : removed;
    rows.ids.push_back(kept.id);
    rows.parent.push_back(kept.parent);
    rows.rotations.push_back(quaternion_of(kept.T_kp));
    rows.translations.push_back(row_of(kept.T_kp.translation()));
    rows.scale.push_back(kept.scale);
    rows.parent_scale.push_back(kept.parent_scale);
  }
}

}  // namespace

std::vector<ArchivedPose> MapContentsAccess::archived(const Map& map) {
  std::vector<ArchivedPose> all;
  all.reserve(map.archive_.size());
  for (const auto& [id, entry] : map.archive_) {
    all.push_back({id, entry.parent, entry.T_kp, entry.scale, entry.parent_scale});
  }
  std::sort(all.begin(), all.end(),
            [](const ArchivedPose& a, const ArchivedPose& b) { return a.id < b.id; });
  return all;
}

ArchivedPose MapContentsAccess::relative_to_root(const Map& map, KeyFrameId id) {
  const ScaledPose pose = map.scaled_pose(id);
  const KeyFrameId root_id = map.root(map.map_of(id));
  const ScaledPose root = map.scaled_pose(root_id);
  return {id, root_id, pose.T_cw * root.T_cw.inverse(), pose.scale, root.scale};
}

MapContents take_contents(const Map& map, const ContentsKnown& known, bool with_patches) {
  MapContents contents;
  {
    const auto lock = map.read_lock();
    contents.epoch = map.epoch();
    contents.next_keyframe = MapContentsAccess::next_keyframe(map);
    contents.next_point = MapContentsAccess::next_point(map);
    copy_keyframes(map, contents);
    note_changed_keyframes(map, known.keyframe_stamp, contents);
    copy_points(map, known, with_patches, contents);
    if (with_patches) copy_aligned(map, known.keyframe_stamp, contents.aligned);
    // Until something was measured or assumed, these are what a new map has.
    const bool any = map.noise().position.value() < 1 || map.noise().position.n_measured() > 0;
    if (with_patches && any)
      contents.noise = {row_of(map.noise().position), row_of(map.noise().right)};
    copy_removed(map, contents);
  }
  list_cameras(contents);
  list_cameras_of_patches(contents);
  return contents;
}

void copy_keypoints(const Frame& frame, const WritableKeypoints& into, std::size_t first) {
  const std::size_t n = frame.size();
  const auto& raw = frame.raw_keypoints.empty() ? frame.keypoints : frame.raw_keypoints;
  for (std::size_t i = 0; i < n; ++i) {
    const Keypoint& keypoint = frame.keypoints[i];
    into.keypoints[2 * (first + i)] = keypoint.x;
    into.keypoints[2 * (first + i) + 1] = keypoint.y;
    if (into.raw_keypoints) {
      into.raw_keypoints[2 * (first + i)] = raw[i].x;
      into.raw_keypoints[2 * (first + i) + 1] = raw[i].y;
    }
    into.octave[first + i] = static_cast<std::uint8_t>(keypoint.level);
    into.angle[first + i] = keypoint.angle;
    into.response[first + i] = keypoint.response;
  }
  if (into.colours) {
    std::uint8_t* const colours = into.colours + 3 * first;
    if (frame.colours.empty()) {
      std::fill_n(colours, 3 * n, std::uint8_t{0});
    } else if (n > 0) {
      std::memcpy(colours, frame.colours.data(), 3 * n);
    }
  }
  if (into.words && frame.described) {
    std::uint32_t* const words = into.words + first;
    std::fill_n(words, n, kNoWord);
    const DirectIndex& index = frame.direct_index;
    for (std::size_t i = 0; i < index.indices.size(); ++i) words[index.indices[i]] = index.words[i];
  }
  if (n == 0) return;
  static_assert(sizeof(Descriptor) == 32);
  std::memcpy(into.descriptors + 32 * first, frame.descriptors.data(), 32 * n);
  std::memcpy(into.depth + first, frame.depth.data(), sizeof(float) * n);
  std::memcpy(into.right_u + first, frame.right_u.data(), sizeof(float) * n);
}

}  // namespace orbslam
