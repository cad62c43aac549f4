// SPDX-License-Identifier: BSD-3-Clause
#include "map/stored_map.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>

#include "base/errors.hpp"
#include "map/contents_access.hpp"

namespace orbslam {
namespace {

constexpr float kPatchSize = 31.0F;  // OrbExtractor: diameter on level 0 [px]

Pose pose_of(const Quaternion& q, const Vector3& t) {
  return Pose::from_unit(Eigen::Quaterniond(q[3], q[0], q[1], q[2]),
                         Eigen::Vector3d(t[0], t[1], t[2]));
}

Eigen::Vector3d vector_of(const Vector3& v) { return {v[0], v[1], v[2]}; }

void restore_keyframes(Map& map, const StoredMap& stored,
                       const std::vector<std::shared_ptr<const Frame>>& frames) {
  const auto& rows = stored.keyframes;
  for (std::size_t i = 0; i < rows.ids.size; ++i) {
    auto keyframe = std::make_unique<KeyFrame>();
    keyframe->id = KeyFrameId(rows.ids[i]);
    keyframe->frame = frames[i];
    keyframe->T_cw = pose_of(rows.rotations[i], rows.translations[i]);
    keyframe->scale = rows.scale[i];
    keyframe->map_points.resize(frames[i]->size());
    keyframe->parent = KeyFrameId(rows.parent[i]);
    keyframe->provisional_parent = rows.provisional_parent[i] != 0;
    keyframe->processed = rows.processed[i] != 0;
    keyframe->published = true;
    MapContentsAccess::add(map, std::move(keyframe));
  }
}

void restore_points(Map& map, const StoredMap& stored) {
  const auto& rows = stored.points;
  const auto& seen = stored.observations;
  std::size_t o = 0;
  for (std::size_t i = 0; i < rows.ids.size; ++i) {
    auto point = std::make_unique<MapPoint>();
    point->id = MapPointId(rows.ids[i]);
    point->position = vector_of(rows.positions[i]);
    point->mean_direction = vector_of(rows.mean_directions[i]);
    point->min_distance = rows.min_distance[i];
    point->max_distance = rows.max_distance[i];
    std::memcpy(&point->descriptor, rows.descriptors + 32 * i, 32);
    point->n_visible = SightingCount(rows.n_visible[i]);
    point->n_found = SightingCount(rows.n_found[i]);
    point->reference_keyframe = KeyFrameId(rows.reference_keyframe[i]);
    point->first_keyframe = KeyFrameId(rows.first_keyframe[i]);
    point->first_frame = rows.first_frame[i];
    std::size_t end = o;
    while (end < seen.point.size && seen.point[end] == rows.ids[i]) ++end;
    point->observations.reserve(end - o);
    for (; o < end; ++o) {
      point->observations.push_back(
          {KeyFrameId(seen.keyframe[o]), static_cast<std::uint32_t>(seen.keypoint[o]), false});
    }
    MapContentsAccess::add(map, std::move(point));
  }
}

void restore_patches(Map& map, const StoredMap& stored,
                     const std::vector<std::shared_ptr<const Frame>>& frames) {
  const auto& rows = stored.patches;
  if (rows.point.size == 0) return;
  auto cameras = restore_cameras(stored);
  auto scales = restore_scales(stored);
  for (std::size_t i = 0; i < frames.size(); ++i) {  // those that the keyframes have already
    const auto camera = static_cast<std::size_t>(stored.keyframes.camera[i]);
    cameras[camera] = frames[i]->camera;
    scales[camera] = frames[i]->scales;
  }
  constexpr std::size_t kValues = ReferencePatch::kSize * ReferencePatch::kSize;
  for (std::size_t i = 0; i < rows.point.size; ++i) {
    auto patch = std::make_shared<PointPatch>();
    static_assert(sizeof(patch->patch.values) == kValues * sizeof(std::uint16_t));
    std::memcpy(&patch->patch.values, rows.values + kValues * i, sizeof(patch->patch.values));
    patch->patch.fraction = {rows.fraction[i][0], rows.fraction[i][1]};
    patch->keyframe = KeyFrameId(rows.keyframe[i]);
    patch->camera = cameras[static_cast<std::size_t>(rows.camera[i])];
    patch->scales = scales[static_cast<std::size_t>(rows.camera[i])];
    patch->level = rows.level[i];
    patch->pixel = {rows.pixel[i][0], rows.pixel[i][1]};
    map.set_patch(MapPointId(rows.point[i]), std::move(patch));
  }
}

/// Sightings that were aligned to a patch that is gone do not count.
void restore_aligned(Map& map, const StoredMap& stored) {
  const auto& rows = stored.aligned;
  for (std::size_t i = 0; i < rows.keyframe.size; ++i) {
    AlignedSighting sighting;
    sighting.point = MapPointId(rows.point[i]);
    const MapPoint* point = map.find(sighting.point);
    if (!point || !point->patch) continue;
    sighting.u = rows.position[i][0];
    sighting.v = rows.position[i][1];
    sighting.right_u = rows.right_u[i];
    sighting.variance = rows.variance[i];
    sighting.right_variance = rows.right_variance[i];
    sighting.reference = rows.reference[i] != 0;
    map.set_aligned(KeyFrameId(rows.keyframe[i]), static_cast<std::size_t>(rows.keypoint[i]),
                    sighting);
  }
  if (stored.noise.size != 2) return;
  const auto restore = [](const NoiseRow& row, NoiseFactor& noise) {
    noise.restore(row[0], static_cast<int>(row[1]));
  };
  restore(stored.noise[0], map.noise().position);
  restore(stored.noise[1], map.noise().right);
}

}  // namespace

KeyFrame& MapContentsAccess::add(Map& map, std::unique_ptr<KeyFrame> keyframe) {
  ++map.n_published_;
  const KeyFrameId id = keyframe->id;
  return map.keyframes_.insert(id, std::move(keyframe));
}

MapPoint& MapContentsAccess::add(Map& map, std::unique_ptr<MapPoint> point) {
  for (Observation& observation : point->observations) {
    KeyFrame& observer = map.keyframe(observation.keyframe);
    observation.has_depth = observer.frame->has_depth(observation.index);
    point->observation_count += observation.has_depth ? 2 : 1;
    observer.map_points[observation.index] = point->id;
  }
  const MapPointId id = point->id;
  return map.points_.insert(id, std::move(point));
}

void MapContentsAccess::add(Map& map, const ArchivedPose& removed) {
  map.archive_.emplace(removed.id, Map::ArchivedKeyFrame{removed.parent, removed.T_kp,
                                                         removed.scale, removed.parent_scale});
}

void MapContentsAccess::set_next_ids(Map& map, KeyFrameId keyframe, MapPointId point) {
  map.next_keyframe_ = keyframe;
  map.next_point_ = point;
}

void MapContentsAccess::set_weight(Map& map, KeyFrameId a, KeyFrameId b, int weight) {
  map.keyframe(a).weights.emplace(b, weight);
  map.keyframe(b).weights.emplace(a, weight);
}

void MapContentsAccess::finish(Map& map) {
  for (const KeyFrameId id : map.keyframe_ids()) {
    KeyFrame& keyframe = map.keyframe(id);
    if (keyframe.parent.valid()) map.keyframe(keyframe.parent).children.insert(id);
    Map::sort_neighbours(keyframe);
  }
  std::map<MapIndex, Map::Part> parts;
  MapIndex next = map.active_map();
  for (const KeyFrameId id : map.keyframe_ids()) {
    if (!map.keyframe(id).parent.valid()) parts.emplace(next++, Map::Part{id, 0});
  }
  std::vector<const KeyFrame*> below;
  for (auto& [index, part] : parts) {
    below.assign(1, &map.keyframe(part.root));
    for (std::size_t i = 0; i < below.size(); ++i) {
      map.keyframe(below[i]->id).map = index;
      for (const KeyFrameId child : below[i]->children) below.push_back(map.find(child));
    }
    part.n_published = below.size();
  }
  const auto largest = std::max_element(
      parts.begin(), parts.end(),
      [](const auto& a, const auto& b) { return a.second.n_published < b.second.n_published; });
  if (largest != parts.end()) {
    map.active_map_ = largest->first;
    map.last_map_ = next - 1;
    map.parts_ = std::move(parts);
  }
  ++map.structure_version_;
  ++map.geometry_version_;
}

std::vector<std::shared_ptr<const Camera>> restore_cameras(const StoredMap& stored) {
  std::vector<std::shared_ptr<const Camera>> cameras;
  for (const CameraContents& contents : stored.cameras) {
    try {
      cameras.push_back(std::make_shared<Camera>(contents.camera));
    } catch (const SettingsError& error) {
      throw MapFileError("camera " + std::to_string(cameras.size()) +
                         " is impossible: " + error.what());
    }
  }
  return cameras;
}

std::vector<std::shared_ptr<const ScalePyramid>> restore_scales(const StoredMap& stored) {
  std::vector<std::shared_ptr<const ScalePyramid>> scales;
  for (const CameraContents& contents : stored.cameras) {
    try {
      scales.push_back(std::make_shared<ScalePyramid>(contents.scale_factor, contents.n_levels));
    } catch (const SettingsError& error) {
      throw MapFileError("the image pyramid of camera " + std::to_string(scales.size()) +
                         " is impossible: " + error.what());
    }
  }
  return scales;
}

std::shared_ptr<Frame> restore_frame(
    const StoredMap& stored, const StoredKeypoints& keypoints, std::size_t row,
    const std::vector<std::shared_ptr<const Camera>>& cameras,
    const std::vector<std::shared_ptr<const ScalePyramid>>& scales) {
  const ReadableKeypoints& columns = keypoints.columns;
  const auto& offsets = stored.keyframes.offsets;
  const auto camera = static_cast<std::size_t>(stored.keyframes.camera[row]);
  const auto first = static_cast<std::size_t>(offsets[row] - offsets[keypoints.first_row]);
  const auto n = static_cast<std::size_t>(offsets[row + 1] - offsets[row]);
  auto frame = std::make_shared<Frame>();
  frame->id = stored.keyframes.frame_ids[row];
  frame->timestamp = stored.keyframes.timestamps[row];
  frame->camera = cameras[camera];
  frame->scales = scales[camera];
  frame->keypoints.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    Keypoint& keypoint = frame->keypoints[i];
    keypoint.x = columns.keypoints[2 * (first + i)];
    keypoint.y = columns.keypoints[2 * (first + i) + 1];
    keypoint.level = columns.octave[first + i];
    keypoint.size = std::trunc(kPatchSize * frame->scales->scale(keypoint.level));
    keypoint.angle = columns.angle[first + i];
    keypoint.response = columns.response[first + i];
  }
  if (frame->camera->distorts()) {
    frame->raw_keypoints = frame->keypoints;
    for (std::size_t i = 0; i < n; ++i) {
      frame->raw_keypoints[i].x = columns.raw_keypoints[2 * (first + i)];
      frame->raw_keypoints[i].y = columns.raw_keypoints[2 * (first + i) + 1];
    }
  }
  frame->descriptors.resize(n);
  if (n > 0) std::memcpy(frame->descriptors.data(), columns.descriptors + 32 * first, 32 * n);
  frame->depth.assign(columns.depth + first, columns.depth + first + n);
  frame->right_u.assign(columns.right_u + first, columns.right_u + first + n);
  if (columns.colours && stored.keyframes.has_colours[row] != 0) {
    frame->colours.resize(n);
    if (n > 0) std::memcpy(frame->colours.data(), columns.colours + 3 * first, 3 * n);
  }
  frame->grid = KeypointGrid(frame->keypoints, frame->camera->bounds());
  return frame;
}

void restore_map(Map& map, const StoredMap& stored,
                 const std::vector<std::shared_ptr<const Frame>>& frames) {
  const auto lock = map.write_lock();
  if (MapContentsAccess::next_keyframe(map).value != 0) {
    throw StateError("a map can be loaded into an empty one only; make a new system");
  }
  restore_keyframes(map, stored, frames);
  restore_points(map, stored);
  restore_patches(map, stored, frames);
  restore_aligned(map, stored);
  const auto& edges = stored.covisibility;
  for (std::size_t i = 0; i < edges.a.size; ++i) {
    MapContentsAccess::set_weight(map, KeyFrameId(edges.a[i]), KeyFrameId(edges.b[i]),
                                  edges.weight[i]);
  }
  for (std::size_t i = 0; i < stored.loop_edges.size; ++i) {
    map.add_loop_edge(KeyFrameId(stored.loop_edges[i][0]), KeyFrameId(stored.loop_edges[i][1]));
  }
  const auto& removed = stored.removed_keyframes;
  for (std::size_t i = 0; i < removed.ids.size; ++i) {
    MapContentsAccess::add(map, {KeyFrameId(removed.ids[i]), KeyFrameId(removed.parent[i]),
                                 pose_of(removed.rotations[i], removed.translations[i]),
                                 removed.scale[i], removed.parent_scale[i]});
  }
  MapContentsAccess::set_next_ids(map, KeyFrameId(stored.next_keyframe),
                                  MapPointId(stored.next_point));
  MapContentsAccess::finish(map);
}

}  // namespace orbslam
