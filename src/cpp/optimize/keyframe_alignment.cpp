// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/keyframe_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "base/parallel.hpp"
#include "base/sort_unique.hpp"
#include "optimize/patch_search.hpp"

namespace orbslam {
namespace {

/// Quantile of the residuals from which the noise is measured. It is high, because the gates depend
/// on the noise and must keep sightings with systematic errors.
constexpr double kShare = 0.9;
/// Quantiles of the chi-square distribution at that share, by degrees of freedom.
constexpr double kOfOne = 2.7055435, kOfTwo = 4.6051702;
/// Sightings that a thread takes at a time.
constexpr std::size_t kChunk = 64;
/// Noise factor of a depth sensor before the first measurement. It is low, because the first
/// geometry is reliable.
constexpr double kFirstWithDepths = 0.2;
/// Least number of residuals for a measurement of the noise.
constexpr std::size_t kFewestResiduals = 100;

/// A keyframe with its images.
struct View {
  KeyFrameId keyframe;
  std::shared_ptr<const Frame> frame;
  std::shared_ptr<const FrameImages::Pyramids> images;
  Pose T_cw;
};

struct Sighting {
  std::size_t view = 0;
  std::uint32_t slot = 0;
  std::size_t point = 0;
  bool is_new = false;  ///< not tried yet
  AlignmentFailure failure = AlignmentFailure::kOutside;
  AlignedSighting result;
};

struct Point {
  MapPointId id;
  Eigen::Vector3d position;
  std::shared_ptr<const PointPatch> patch;
  Pose T_rw;  ///< of the patch's keyframe
  bool is_new = false;
  std::optional<PlacedPatch> placed;
};

/// Data of the map about the sightings to be aligned.
struct Task {
  std::vector<View> views;
  std::vector<Point> points;
  std::vector<Sighting> sightings;  ///< of a point one after the other, the youngest keyframe first
  std::uint64_t epoch = 0;
};

std::vector<View> views_of(const Map& map, const KeyFrame& current) {
  std::vector<KeyFrameId> ids = current.neighbours;
  ids.push_back(current.id);
  sort_unique(ids);
  std::vector<View> views;
  for (const KeyFrameId id : ids) {
    const KeyFrame* keyframe = map.find(id);
    if (keyframe == nullptr || !keyframe->frame->images) continue;
    if (auto images = keyframe->frame->images->get()) {
      views.push_back({id, keyframe->frame, std::move(images), keyframe->T_cw});
    }
  }
  return views;
}

/// Ids of the points with a sighting in these views that was not tried yet.
std::vector<MapPointId> points_to_align(const Map& map, const std::vector<View>& views) {
  std::vector<MapPointId> ids;
  for (const View& view : views) {
    const KeyFrame& keyframe = *map.find(view.keyframe);
    for (std::size_t i = 0; i < keyframe.map_points.size(); ++i) {
      const MapPointId id = keyframe.map_points[i];
      if (!id.valid()) continue;
      if (keyframe.aligned.empty() || keyframe.aligned[i].point != id) ids.push_back(id);
    }
  }
  sort_unique(ids);
  return ids;
}

Task gather(const Map& map, KeyFrameId current) {
  Task task;
  const auto lock = map.read_lock();
  task.epoch = map.epoch();
  const KeyFrame* keyframe = map.find(current);
  if (keyframe == nullptr) return task;
  task.views = views_of(map, *keyframe);
  for (const MapPointId id : points_to_align(map, task.views)) {
    const MapPoint* point = map.find(id);
    if (point == nullptr) continue;
    Point added{id, point->position, point->patch, Pose(), false, std::nullopt};
    if (added.patch) added.T_rw = map.T_cw(added.patch->keyframe);
    for (std::size_t v = task.views.size(); v-- > 0;) {
      const Observation* o = point->observation_of(task.views[v].keyframe);
      if (o == nullptr) continue;
      Sighting sighting;
      sighting.view = v;
      sighting.slot = o->index;
      sighting.point = task.points.size();
      const auto& aligned = map.find(o->keyframe)->aligned;
      sighting.is_new = aligned.empty() || aligned[o->index].point != id;
      task.sightings.push_back(sighting);
    }
    task.points.push_back(std::move(added));
  }
  return task;
}

/// The patch of the youngest sighting that is not too near to a border.
void cut_missing_patches(Task& task) {
  for (const Sighting& sighting : task.sightings) {
    Point& point = task.points[sighting.point];
    if (point.patch) continue;
    const View& view = task.views[sighting.view];
    auto patch = std::make_shared<PointPatch>();
    if (!cut_patch_at(*view.frame, sighting.slot, view.images->left, patch->patch)) continue;
    patch->keyframe = view.keyframe;
    patch->camera = view.frame->camera;
    patch->scales = view.frame->scales;
    patch->level = view.frame->keypoints[sighting.slot].level;
    patch->pixel = raw_pixel(*view.frame, sighting.slot);
    point.patch = std::move(patch);
    point.T_rw = view.T_cw;
    point.is_new = true;
  }
}

void align_one(const Task& task, Sighting& sighting) {
  const Point& point = task.points[sighting.point];
  if (!point.placed) return;
  const View& view = task.views[sighting.view];
  const Frame& frame = *view.frame;
  const PointPatch& patch = *point.patch;
  const Keypoint& keypoint = frame.keypoints[sighting.slot];
  AlignedSighting& result = sighting.result;
  result.point = point.id;
  result.reference =
      patch.keyframe == view.keyframe && patch.pixel == raw_pixel(frame, sighting.slot);
  if (result.reference) {
    sighting.failure = AlignmentFailure::kNone;
    result.u = keypoint.x;
    result.v = keypoint.y;
    result.variance =
        static_cast<float>(kLeastAlignedVariance) * frame.scales->sigma2(keypoint.level);
  } else {
    const FoundPatch found = find_patch(*point.placed, frame, view.T_cw, view.images->left,
                                        raw_pixel(frame, sighting.slot));
    sighting.failure = found.failure;
    if (!found.ok()) return;
    result.u = found.u;
    result.v = found.v;
    result.variance = found.variance;
  }
  if (!frame.has_depth(sighting.slot)) return;
  result.right_u = frame.right_u[sighting.slot] + (result.u - keypoint.x);
  // The disparity stays, with the noise that it has.
  const float own = frame.right_variance.empty() ? 0 : frame.right_variance[sighting.slot];
  if (own > 0) result.right_variance = own + (result.reference ? 0 : result.variance);
}

void commit(const Task& task, bool patches_only, Map& map) {
  const auto lock = map.write_lock();
  if (map.epoch() != task.epoch) return;
  for (const Point& point : task.points) {
    const MapPoint* living = map.find(point.id);
    if (point.is_new && living != nullptr && !living->patch) map.set_patch(point.id, point.patch);
  }
  if (patches_only) return;
  for (const Sighting& sighting : task.sightings) {
    if (!sighting.is_new || !sighting.result.point.valid()) continue;
    map.set_aligned(task.views[sighting.view].keyframe, sighting.slot, sighting.result);
  }
}

double factor_of(std::vector<double>& squares, double quantile, double lost) {
  const double index = kShare * static_cast<double>(squares.size() - 1);
  const auto at = squares.begin() + static_cast<std::ptrdiff_t>(index);
  std::nth_element(squares.begin(), at, squares.end());
  return std::sqrt(*at / quantile * lost);
}

/// The first measurement replaces the initial factor, because depths make the geometry of a young
/// map reliable.
void follow(NoiseFactor& noise, double factor) {
  if (noise.n_measured() == 0 && factor > 0) noise.assume(std::min(factor, 1.0));
  noise.measure(factor);
}

}  // namespace

KeyframeAlignment align_keyframes(Map& map, KeyFrameId current, bool patches_only, int n_threads) {
  KeyframeAlignment result;
  Task task = gather(map, current);
  if (task.sightings.empty()) return result;
  const auto& depth = task.views.front().frame->depth;
  const bool has_depths = std::any_of(depth.begin(), depth.end(), [](float z) { return z > 0; });
  if (has_depths && map.noise().position.n_measured() == 0) {
    map.noise().position.assume(kFirstWithDepths);
  }
  cut_missing_patches(task);
  for (const Point& point : task.points) result.n_patches += point.is_new ? 1 : 0;
  if (!patches_only) {
    for (Point& point : task.points) {
      if (!point.patch) continue;
      point.placed = place_patch(*point.patch, point.T_rw, point.position);
    }
    const std::size_t n = task.sightings.size();
    for_each_in_parallel((n + kChunk - 1) / kChunk, static_cast<std::size_t>(n_threads),
                         [&](std::size_t chunk) {
                           const std::size_t end = std::min(n, (chunk + 1) * kChunk);
                           for (std::size_t i = chunk * kChunk; i < end; ++i) {
                             if (task.sightings[i].is_new) align_one(task, task.sightings[i]);
                           }
                         });
    for (const Sighting& s : task.sightings) {
      if (s.is_new && s.result.point.valid()) ++result.counts[static_cast<std::size_t>(s.failure)];
    }
  }
  commit(task, patches_only, map);
  return result;
}

void measure_noise(const GatheredBundle& bundle, NoiseFactors& noise) {
  const BundleProblem& problem = bundle.problem;
  std::vector<double> squares, right_squares;
  double n_residuals = 0;
  bool has_depths = false;
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    const auto& o = problem.observations[i];
    n_residuals += o.has_depth ? 3 : 2;
    has_depths |= o.has_depth;
    const ObservationKind kind = bundle.kinds[i];
    if (kind != ObservationKind::kAligned && kind != ObservationKind::kAlignedRight) continue;
    const auto& camera = problem.cameras[o.camera];
    const Eigen::Vector3d p = camera.T_cw * problem.points[o.point];
    Eigen::Vector2d error;
    if (!camera.model->error(p, o.u, o.v, error)) continue;
    const double corner = o.inverse_sigma2 / noise.position.weight();
    squares.push_back(corner * error.squaredNorm());
    if (kind != ObservationKind::kAlignedRight || !o.has_depth) continue;
    const double right = camera.model->right_error(p, error, o.u, o.v, o.right_u);
    right_squares.push_back(corner * right * right);
  }
  // Without depths, poses and points absorb the errors of the calibration, and the residuals do not
  // show them. The sightings of a single camera therefore keep the noise of a corner.
  if (!has_depths) return;
  const double n_free = static_cast<double>(problem.cameras.size()) - bundle.n_fixed();
  const double n_unknowns = 3 * static_cast<double>(problem.points.size()) + 6 * n_free;
  if (squares.size() < kFewestResiduals || !(n_residuals > 1.2 * n_unknowns)) return;
  // The unknowns of the adjustment absorb this part of the noise.
  const double lost = n_residuals / (n_residuals - n_unknowns);
  follow(noise.position, factor_of(squares, kOfTwo, lost));
  if (right_squares.size() < kFewestResiduals) return;
  follow(noise.right, factor_of(right_squares, kOfOne, lost));
}

}  // namespace orbslam
