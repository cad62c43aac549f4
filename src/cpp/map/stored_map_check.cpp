// SPDX-License-Identifier: BSD-3-Clause
// check_stored_map(): contents of a file are checked completely.
#include <algorithm>
#include <cmath>
#include <string>

#include "base/errors.hpp"
#include "map/stored_map.hpp"

namespace orbslam {
namespace {

/// Distance from 1 of the length of a unit quaternion: far above rounding, far below harm.
constexpr double kUnitTolerance = 1e-9;
/// No run is long enough to reach this limit: counters grow by one per frame.
constexpr std::int32_t kMaxCount = 1 << 30;
/// Pixels; images are far smaller.
constexpr float kMaxCoordinate = 1e6F;
/// Ids are looked up in tables as long as the largest id, so a small map may not have huge ones.
/// Culling leaves several dozen ids unused for every one that lives.
constexpr std::int64_t kIdsPerRow = 4096;
constexpr std::int64_t kFewKeyframeIds = std::int64_t{1} << 20,
                       kFewPointIds = std::int64_t{1} << 24;

[[noreturn]] void refuse(const std::string& what) { throw MapFileError(what); }

std::string keyframe(std::int64_t id) { return "keyframe " + std::to_string(id); }
std::string point(std::int64_t id) { return "point " + std::to_string(id); }

bool finite(const Vector3& v) {
  return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]);
}

bool unit(const Quaternion& q) {
  const double squared = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  return std::abs(squared - 1) <= kUnitTolerance;  // false for NaN
}

bool positive(double value) { return std::isfinite(value) && value > 0; }

/// Row of an id in an ascending column, or -1.
std::int64_t row_of(const Column<std::int64_t>& ids, std::int64_t id) {
  const auto* const found = std::lower_bound(ids.data, ids.data + ids.size, id);
  return found != ids.data + ids.size && *found == id ? found - ids.data : -1;
}

void check_next(std::size_t n_rows, std::int64_t next, std::int64_t few, const char* what) {
  if (next < 0 || next > few + kIdsPerRow * static_cast<std::int64_t>(n_rows)) {
    refuse("the id of the next " + std::string(what) + " is " + std::to_string(next));
  }
}

void check_ids(const Column<std::int64_t>& ids, std::int64_t next, const char* what) {
  for (std::size_t i = 0; i < ids.size; ++i) {
    if (ids[i] < 0 || ids[i] >= next || (i > 0 && ids[i] <= ids[i - 1])) {
      refuse("the id " + std::to_string(ids[i]) + " of a " + what +
             " is negative, out of order or not below the next one");
    }
  }
}

void check_cameras(const StoredMap& stored) {
  constexpr int kLargest = 1 << 16;
  for (const CameraContents& contents : stored.cameras) {
    const ImageSize size = contents.camera.image_size;
    if (size.width > kLargest || size.height > kLargest) {
      refuse("a camera has images of " + std::to_string(size.width) + "x" +
             std::to_string(size.height) + " pixels");
    }
  }
  restore_cameras(stored);
  restore_scales(stored);
}

class KeyFrameCheck {
 public:
  explicit KeyFrameCheck(const StoredMap& stored)
      : stored_(stored), rows_(stored.keyframes), roots_(rows_.ids.size, 0) {}

  /// Per keyframe the row of the root above it: which map it belongs to.
  std::vector<std::size_t> run() {
    check_next(rows_.ids.size, stored_.next_keyframe, kFewKeyframeIds, "keyframe");
    check_ids(rows_.ids, stored_.next_keyframe, "keyframe");
    if (rows_.ids.size == 0) refuse("there is no keyframe");
    if (rows_.ids[0] != 0 && rows_.parent[0] != -1) {
      refuse("keyframe 0, the root of the spanning tree, is missing");
    }
    check_offsets();
    for (std::size_t i = 0; i < rows_.ids.size; ++i) check_row(i);
    check_tree();
    return std::move(roots_);
  }

 private:
  void check_offsets() {
    if (rows_.offsets[0] != 0) refuse("the keypoints do not begin with the first keyframe");
    for (std::size_t i = 0; i < rows_.ids.size; ++i) {
      if (rows_.offsets[i + 1] < rows_.offsets[i]) {
        refuse(keyframe(rows_.ids[i]) + " has a negative number of keypoints");
      }
    }
    if (rows_.offsets[rows_.ids.size] != static_cast<std::int64_t>(stored_.n_keypoints)) {
      refuse("the keyframes count other keypoints than there are");
    }
  }

  void check_row(std::size_t i) {
    const std::string name = keyframe(rows_.ids[i]);
    if (!unit(rows_.rotations[i]) || !finite(rows_.translations[i])) {
      refuse("the pose of " + name + " is not a rotation and a finite translation");
    }
    if (!std::isfinite(rows_.timestamps[i])) refuse("the time stamp of " + name + " is not finite");
    if (!positive(rows_.scale[i])) refuse("the scale of " + name + " is not positive");
    if (rows_.camera[i] < 0 ||
        rows_.camera[i] >= static_cast<std::int64_t>(stored_.cameras.size())) {
      refuse(name + " has the camera " + std::to_string(rows_.camera[i]) + ", which is not there");
    }
  }

  void check_tree() {
    // 0: not looked at, 1: on the way up from a later one, 2: leads to a root.
    std::vector<std::uint8_t> state(rows_.ids.size, 0);
    state[0] = 2;
    if (rows_.parent[0] != -1) refuse("keyframe 0 has a parent in the spanning tree");
    roots_[0] = 0;
    std::vector<std::size_t> way;
    for (std::size_t i = 1; i < rows_.ids.size; ++i) {
      way.clear();
      std::size_t at = i;
      while (state[at] == 0) {
        if (rows_.parent[at] == -1) {  // the root of another map
          state[at] = 2;
          roots_[at] = at;
          break;
        }
        state[at] = 1;
        way.push_back(at);
        const std::int64_t parent = row_of(rows_.ids, rows_.parent[at]);
        if (parent < 0) {
          refuse(keyframe(rows_.ids[at]) + " has the parent " + std::to_string(rows_.parent[at]) +
                 ", which is not there");
        }
        at = static_cast<std::size_t>(parent);
      }
      if (state[at] == 1) refuse(keyframe(rows_.ids[at]) + " is its own ancestor");
      for (const std::size_t passed : way) {
        state[passed] = 2;
        roots_[passed] = roots_[at];
      }
    }
  }

  const StoredMap& stored_;
  const decltype(StoredMap::keyframes)& rows_;
  std::vector<std::size_t> roots_;
};

void check_keypoints_of(const StoredMap& stored, const StoredKeypoints& keypoints,
                        std::size_t row) {
  const auto& rows = stored.keyframes;
  const ReadableKeypoints& columns = keypoints.columns;
  const int n_levels = stored.cameras[static_cast<std::size_t>(rows.camera[row])].n_levels;
  const auto first = static_cast<std::size_t>(rows.offsets[row]);
  const auto before = static_cast<std::size_t>(rows.offsets[keypoints.first_row]);
  const auto end = static_cast<std::size_t>(rows.offsets[row + 1]);
  const auto in_range = [](const float* xy) {
    return std::abs(xy[0]) <= kMaxCoordinate && std::abs(xy[1]) <= kMaxCoordinate;
  };
  for (std::size_t k = first - before; k < end - before; ++k) {
    const float depth = columns.depth[k], angle = columns.angle[k];
    const bool good = in_range(columns.keypoints + 2 * k) &&
                      (!columns.raw_keypoints || in_range(columns.raw_keypoints + 2 * k)) &&
                      columns.octave[k] < n_levels && angle >= 0 && angle < 360 &&
                      std::isfinite(columns.response[k]) && std::isfinite(depth) &&
                      (depth > 0 || depth == -1) && std::isfinite(columns.right_u[k]);
    if (good) continue;
    refuse("keypoint " + std::to_string(k - (first - before)) + " of " + keyframe(rows.ids[row]) +
           " has a number out of range");
  }
}

void check_removed(const StoredMap& stored) {
  const auto& rows = stored.removed_keyframes;
  check_ids(rows.ids, stored.next_keyframe, "removed keyframe");
  std::vector<std::uint8_t> state(rows.ids.size, 0);  // as in check_tree()
  std::vector<std::size_t> way;
  for (std::size_t i = 0; i < rows.ids.size; ++i) {
    const std::string name = "removed " + keyframe(rows.ids[i]);
    if (row_of(stored.keyframes.ids, rows.ids[i]) >= 0) refuse(name + " is in the map as well");
    if (!unit(rows.rotations[i]) || !finite(rows.translations[i]) || !positive(rows.scale[i]) ||
        !positive(rows.parent_scale[i])) {
      refuse("the pose of " + name + " is not a rotation, a finite translation and a scale");
    }
    way.clear();
    std::size_t at = i;
    while (state[at] == 0) {
      state[at] = 1;
      way.push_back(at);
      if (row_of(stored.keyframes.ids, rows.parent[at]) >= 0) {
        state[at] = 2;
        break;
      }
      const std::int64_t parent = row_of(rows.ids, rows.parent[at]);
      if (parent < 0) refuse(name + " hangs on a keyframe that is not there");
      at = static_cast<std::size_t>(parent);
    }
    if (state[at] == 1) refuse(name + " hangs on itself");
    for (const std::size_t passed : way) state[passed] = 2;
  }
}

void check_point_row(const StoredMap& stored, std::size_t i) {
  const auto& rows = stored.points;
  const Vector3& d = rows.mean_directions[i];
  const double squared = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
  const bool good = finite(rows.positions[i]) && squared <= 1 + 1e-6 && rows.min_distance[i] >= 0 &&
                    rows.max_distance[i] >= rows.min_distance[i] &&
                    std::isfinite(rows.max_distance[i]) && rows.n_visible[i] >= 1 &&
                    rows.n_visible[i] <= kMaxCount && rows.n_found[i] >= 0 &&
                    rows.n_found[i] <= kMaxCount && rows.first_keyframe[i] >= 0 &&
                    rows.first_keyframe[i] < stored.next_keyframe;
  if (!good) refuse(point(rows.ids[i]) + " has a number out of range");
}

void check_points(const StoredMap& stored, const std::vector<std::size_t>& roots) {
  const auto& rows = stored.points;
  const auto& seen = stored.observations;
  check_next(rows.ids.size, stored.next_point, kFewPointIds, "point");
  check_ids(rows.ids, stored.next_point, "point");
  std::vector<bool> taken(stored.n_keypoints, false);
  std::size_t o = 0;
  for (std::size_t i = 0; i < rows.ids.size; ++i) {
    check_point_row(stored, i);
    bool reference_sees_it = false;
    std::size_t root = 0;
    const std::size_t first = o;
    for (; o < seen.point.size && seen.point[o] == rows.ids[i]; ++o) {
      const std::int64_t row = row_of(stored.keyframes.ids, seen.keyframe[o]);
      if (row < 0 || (o > first && seen.keyframe[o] <= seen.keyframe[o - 1])) {
        refuse(point(rows.ids[i]) + " is seen by " + keyframe(seen.keyframe[o]) +
               ", which is not there or out of order");
      }
      if (o > first && roots[static_cast<std::size_t>(row)] != root) {
        refuse(point(rows.ids[i]) + " is seen by keyframes of two maps");
      }
      root = roots[static_cast<std::size_t>(row)];
      const std::int64_t begin = stored.keyframes.offsets[static_cast<std::size_t>(row)];
      const std::int64_t end = stored.keyframes.offsets[static_cast<std::size_t>(row) + 1];
      const std::int64_t slot = begin + seen.keypoint[o];
      if (seen.keypoint[o] < 0 || slot >= end || taken[static_cast<std::size_t>(slot)]) {
        refuse(point(rows.ids[i]) + " is seen at keypoint " + std::to_string(seen.keypoint[o]) +
               " of " + keyframe(seen.keyframe[o]) + ", which is not there or another point's");
      }
      taken[static_cast<std::size_t>(slot)] = true;
      reference_sees_it |= seen.keyframe[o] == rows.reference_keyframe[i];
    }
    if (!reference_sees_it) refuse(point(rows.ids[i]) + " is not seen by its reference keyframe");
  }
  if (o != seen.point.size) {
    refuse("an observation of " + point(seen.point[o]) + " has no such point, or is out of order");
  }
}

void check_edges(const StoredMap& stored, const std::vector<std::size_t>& roots) {
  const auto& edges = stored.covisibility;
  const auto is_edge = [&](std::int64_t a, std::int64_t b) {
    const std::int64_t row_a = row_of(stored.keyframes.ids, a);
    const std::int64_t row_b = row_of(stored.keyframes.ids, b);
    return a < b && row_a >= 0 && row_b >= 0 &&
           roots[static_cast<std::size_t>(row_a)] == roots[static_cast<std::size_t>(row_b)];
  };
  for (std::size_t i = 0; i < edges.a.size; ++i) {
    const bool ascends = i == 0 || edges.a[i] > edges.a[i - 1] ||
                         (edges.a[i] == edges.a[i - 1] && edges.b[i] > edges.b[i - 1]);
    if (!ascends || !is_edge(edges.a[i], edges.b[i]) || edges.weight[i] < 1 ||
        edges.weight[i] > kMaxCount) {
      refuse("the covisibility of " + keyframe(edges.a[i]) + " and " + keyframe(edges.b[i]) +
             " is impossible");
    }
  }
  const auto& loops = stored.loop_edges;
  for (std::size_t i = 0; i < loops.size; ++i) {
    if (!is_edge(loops[i][0], loops[i][1]) || (i > 0 && !(loops[i - 1] < loops[i]))) {
      refuse("the loop edge of " + keyframe(loops[i][0]) + " and " + keyframe(loops[i][1]) +
             " is impossible");
    }
  }
}

void check_patches(const StoredMap& stored) {
  constexpr float kHalf = 0.5F + 1e-3F;
  const auto& rows = stored.patches;
  for (std::size_t i = 0; i < rows.point.size; ++i) {
    const std::string name = "the patch of " + point(rows.point[i]);
    if (row_of(stored.points.ids, rows.point[i]) < 0 ||
        (i > 0 && rows.point[i] <= rows.point[i - 1])) {
      refuse(name + " has no such point, or is out of order");
    }
    if (row_of(stored.keyframes.ids, rows.keyframe[i]) < 0 &&
        row_of(stored.removed_keyframes.ids, rows.keyframe[i]) < 0) {
      refuse(name + " is of " + keyframe(rows.keyframe[i]) + ", which is not known");
    }
    const bool has_camera =
        rows.camera[i] >= 0 && rows.camera[i] < static_cast<std::int64_t>(stored.cameras.size());
    if (!has_camera) {
      refuse(name + " has the camera " + std::to_string(rows.camera[i]) + ", which is not there");
    }
    const bool good =
        rows.level[i] < stored.cameras[static_cast<std::size_t>(rows.camera[i])].n_levels &&
        std::abs(rows.pixel[i][0]) <= kMaxCoordinate &&
        std::abs(rows.pixel[i][1]) <= kMaxCoordinate && std::abs(rows.fraction[i][0]) <= kHalf &&
        std::abs(rows.fraction[i][1]) <= kHalf;
    if (!good) refuse(name + " has a number out of range");
  }
}

void check_aligned(const StoredMap& stored) {
  const auto& rows = stored.aligned;
  const auto is_variance = [](float value) { return std::isfinite(value) && value >= 0; };
  for (std::size_t i = 0; i < rows.keyframe.size; ++i) {
    const std::string name = "the aligned keypoint " + std::to_string(rows.keypoint[i]) + " of " +
                             keyframe(rows.keyframe[i]);
    const std::int64_t row = row_of(stored.keyframes.ids, rows.keyframe[i]);
    const bool ascends =
        i == 0 || rows.keyframe[i] > rows.keyframe[i - 1] ||
        (rows.keyframe[i] == rows.keyframe[i - 1] && rows.keypoint[i] > rows.keypoint[i - 1]);
    if (row < 0 || !ascends) refuse(name + " has no such keyframe, or is out of order");
    const auto& offsets = stored.keyframes.offsets;
    const std::int64_t n =
        offsets[static_cast<std::size_t>(row) + 1] - offsets[static_cast<std::size_t>(row)];
    const bool good = rows.keypoint[i] >= 0 && rows.keypoint[i] < n && rows.point[i] >= 0 &&
                      rows.point[i] < stored.next_point &&
                      std::abs(rows.position[i][0]) <= kMaxCoordinate &&
                      std::abs(rows.position[i][1]) <= kMaxCoordinate &&
                      std::abs(rows.right_u[i]) <= kMaxCoordinate &&
                      is_variance(rows.variance[i]) && is_variance(rows.right_variance[i]);
    if (!good) refuse(name + " has a number out of range");
  }
  if (stored.noise.size != 0 && stored.noise.size != 2) {
    refuse("the noise of aligned sightings has other numbers than two factors");
  }
  for (std::size_t i = 0; i < stored.noise.size; ++i) {
    const auto [factor, measured] = stored.noise[i];
    if (!(factor > 0 && factor <= 1 && measured >= 0 && measured <= kMaxCount)) {
      refuse("the noise of aligned sightings has a number out of range");
    }
  }
}

}  // namespace

void check_stored_map(const StoredMap& stored) {
  check_cameras(stored);
  const std::vector<std::size_t> roots = KeyFrameCheck(stored).run();
  check_removed(stored);
  check_points(stored, roots);
  check_edges(stored, roots);
  check_patches(stored);
  check_aligned(stored);
}

void check_stored_keypoints(const StoredMap& stored, const StoredKeypoints& keypoints) {
  const auto& offsets = stored.keyframes.offsets;
  const bool any = offsets[keypoints.end_row] > offsets[keypoints.first_row];
  for (const auto& camera : restore_cameras(stored)) {
    if (camera->distorts() && !keypoints.columns.raw_keypoints && any) {
      refuse("the raw keypoints of a camera with a distorting lens are missing");
    }
  }
  for (std::size_t row = keypoints.first_row; row < keypoints.end_row; ++row) {
    check_keypoints_of(stored, keypoints, row);
  }
}

}  // namespace orbslam
