// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/local_bundle_adjustment.hpp"

#include <algorithm>
#include <vector>

#include "base/sort_unique.hpp"
#include "optimize/bundle_gather.hpp"
#include "optimize/gates.hpp"
#include "optimize/keyframe_alignment.hpp"

namespace orbslam {
namespace {

// Newest keyframes in time that are local with an IMU.
constexpr std::size_t kInTime = 10;

/// The keyframe, its neighbours and others, by id.
std::vector<KeyFrameId> local_keyframes(const Map& map, const KeyFrame& current,
                                        const std::vector<KeyFrameId>& in_time) {
  std::vector<KeyFrameId> ids = current.neighbours;
  ids.push_back(current.id);
  ids.insert(ids.end(), in_time.begin(), in_time.end());
  sort_unique(ids);
  ids.erase(std::remove_if(ids.begin(), ids.end(),
                           [&](KeyFrameId id) { return map.find(id) == nullptr; }),
            ids.end());
  return ids;
}

std::vector<const MapPoint*> local_points(const Map& map, const std::vector<KeyFrameId>& local) {
  std::vector<MapPointId> ids;
  for (const KeyFrameId keyframe : local) {
    for (const MapPointId id : map.find(keyframe)->map_points) {
      if (id.valid()) ids.push_back(id);
    }
  }
  sort_unique(ids);
  std::vector<const MapPoint*> points;
  for (const MapPointId id : ids) {
    if (const MapPoint* point = map.find(id)) points.push_back(point);
  }
  return points;
}

/// Observers of the points that are not local, by id.
std::vector<KeyFrameId> outer_keyframes(const std::vector<const MapPoint*>& points,
                                        const std::vector<KeyFrameId>& local) {
  std::vector<KeyFrameId> observers;
  for (const MapPoint* point : points) {
    for (const Observation& observation : point->observations) {
      observers.push_back(observation.keyframe);
    }
  }
  sort_unique(observers);
  std::vector<KeyFrameId> outer;
  std::set_difference(observers.begin(), observers.end(), local.begin(), local.end(),
                      std::back_inserter(outer));
  return outer;
}

/// Fixes the oldest keyframe if no other camera is fixed and another one stays free.
void fix_gauge(GatheredBundle& bundle) {
  auto& cameras = bundle.problem.cameras;
  if (cameras.size() > 1 && bundle.n_fixed() == 0) cameras.front().fixed = true;
}

/// Keeps the scale of a single camera's map if only one pose is fixed. Images do not determine the
/// scale, so it can be restored after the solution without a change of the cost. A second fixed
/// pose would also keep the scale, but would distort the map by its initial error.
class ScaleGauge {
 public:
  ScaleGauge(const GatheredBundle& bundle, bool monocular) {
    if (!monocular || bundle.n_fixed() != 1) return;
    for (const auto& camera : bundle.problem.cameras) {
      if (camera.fixed) origin_ = camera.T_cw.center();
    }
    size_ = size_of(bundle.problem);
  }

  void restore(BundleProblem& problem) const {
    const double size = size_of(problem);
    if (!(size_ > 0 && size > 0)) return;
    const double factor = size_ / size;
    for (auto& camera : problem.cameras) {
      if (camera.fixed) continue;
      const Eigen::Vector3d center = scaled(camera.T_cw.center(), factor);
      camera.T_cw = Pose(camera.T_cw.rotation(), -(camera.T_cw.rotation() * center));
    }
    for (Eigen::Vector3d& point : problem.points) point = scaled(point, factor);
  }

 private:
  /// Sum of the distances of all cameras from the fixed one.
  double size_of(const BundleProblem& problem) const {
    double sum = 0;
    for (const auto& camera : problem.cameras) sum += (camera.T_cw.center() - origin_).norm();
    return sum;
  }
  Eigen::Vector3d scaled(const Eigen::Vector3d& position, double factor) const {
    return origin_ + factor * (position - origin_);
  }

  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  double size_ = 0;  ///< 0: the scale is fixed, or measured
};

GatheredBundle gather(const Map& map, KeyFrameId current, const InertialKeyframes* inertial,
                      LocalBundleResult& result) {
  const auto lock = map.read_lock();
  GatheredBundle bundle(map);
  const KeyFrame* keyframe = map.find(current);
  if (keyframe == nullptr) return bundle;
  std::vector<KeyFrameId> in_time;
  if (inertial != nullptr) in_time = inertial->newest(map, keyframe->map, kInTime + 1);
  // The oldest keyframe of the chain is fixed. It is local only if it shares points.
  const std::vector<KeyFrameId> chain = in_time;
  KeyFrameId held;
  if (in_time.size() > kInTime) {
    held = in_time.front();
    in_time.erase(in_time.begin());
  }
  const std::vector<KeyFrameId> local = local_keyframes(map, *keyframe, in_time);
  const std::vector<const MapPoint*> points = local_points(map, local);
  for (const KeyFrameId id : local) {
    const KeyFrame& camera = *map.find(id);
    bundle.add_camera(camera, map.is_root(camera) || id == held);
  }
  for (const KeyFrameId id : outer_keyframes(points, local)) {
    bundle.add_camera(*map.find(id), true);
  }
  if (held.valid() && bundle.camera_of.count(held) == 0) bundle.add_camera(*map.find(held), true);
  bundle.add_points(points, map);
  fix_gauge(bundle);
  if (chain.size() > 1) inertial->add_to(bundle, chain, map);
  result.n_imu_links = static_cast<int>(bundle.problem.inertial.links.size());
  result.n_local_keyframes = static_cast<int>(local.size());
  result.n_fixed_keyframes = bundle.n_fixed();
  result.n_points = static_cast<int>(bundle.points.size());
  result.n_observations = static_cast<int>(bundle.problem.observations.size());
  return bundle;
}

/// Keeps aligned observations that fail their narrow gate if their corner still agrees: the match
/// is right.
void acquit_aligned(const GatheredBundle& bundle, const Map& map,
                    std::vector<std::uint8_t>& outlier) {
  for (std::size_t i = 0; i < outlier.size(); ++i) {
    if (outlier[i] == 0 || bundle.kinds[i] == ObservationKind::kKeypoint) continue;
    const auto& o = bundle.problem.observations[i];
    const auto& camera = bundle.problem.cameras[o.camera];
    const KeyFrame* keyframe = map.find(bundle.keyframes[o.camera]);
    if (keyframe == nullptr) continue;
    const Frame& frame = *keyframe->frame;
    const Keypoint& corner = frame.keypoints[bundle.keypoints[i]];
    const Eigen::Vector3d p = camera.T_cw * bundle.problem.points[o.point];
    Eigen::Vector2d error;
    if (!camera.model->error(p, corner.x, corner.y, error)) continue;
    if (camera.model->is_flat() && !(p.z() > 0)) continue;
    double squared = error.squaredNorm();
    if (o.has_depth) {
      const float right_u = frame.right_u[bundle.keypoints[i]];
      const double right = camera.model->right_error(p, error, corner.x, corner.y, right_u);
      squared += right * right;
    }
    const double gate = o.has_depth ? kGateStereo : kGateMono;
    if (squared * static_cast<double>(frame.scales->inverse_sigma2(corner.level)) <= gate) {
      outlier[i] = 0;
    }
  }
}

}  // namespace

LocalBundleResult local_bundle_adjustment(Map& map, KeyFrameId current,
                                          const std::atomic<bool>* abort, bool monocular,
                                          int n_threads, BundleSolver solver,
                                          InertialKeyframes* inertial, bool measures_noise) {
  LocalBundleResult result;
  if (abort != nullptr && abort->load()) {
    result.summary.aborted = true;
    return result;
  }
  GatheredBundle bundle = gather(map, current, inertial, result);
  if (bundle.problem.observations.empty()) return result;
  BundleOptions options;
  options.n_threads = n_threads;
  options.solver = solver;
  const ScaleGauge scale(bundle, monocular && result.n_imu_links == 0);
  result.summary = solve_bundle(bundle.problem, options, abort);
  // Every accepted step lowers the cost; without an accepted step nothing is written.
  const bool moved = result.summary.iterations > 0;
  if (!moved && !result.summary.stage_one_done) return result;
  if (moved) scale.restore(bundle.problem);

  const auto lock = map.write_lock();
  if (map.epoch() != bundle.epoch) return result;
  // Observations are not erased on the basis of an unfinished estimate.
  if (result.summary.stage_one_done) {
    acquit_aligned(bundle, map, result.summary.outlier);
    result.n_erased = erase_observations(bundle, result.summary.outlier, map);
  }
  if (moved) write_back(bundle, map);
  if (moved && inertial != nullptr) inertial->take_from(bundle, map);
  if (measures_noise && result.summary.stage_one_done) measure_noise(bundle, map.noise());
  result.committed = true;
  return result;
}

}  // namespace orbslam
