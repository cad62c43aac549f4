// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/bundle_gather.hpp"

#include <algorithm>

namespace orbslam {
namespace {

std::uint32_t begin_point(GatheredBundle& bundle, const MapPoint& point) {
  bundle.points.push_back(point.id);
  bundle.problem.points.push_back(point.position);
  return static_cast<std::uint32_t>(bundle.points.size() - 1);
}

void add_observation(GatheredBundle& bundle, std::uint32_t camera, std::uint32_t point,
                     const KeyFrame& keyframe, const Observation& observation,
                     const NoiseFactors& noise) {
  const Frame& frame = *keyframe.frame;
  const Keypoint& keypoint = frame.keypoints[observation.index];
  BundleProblem::Observation o;
  o.camera = camera;
  o.point = point;
  o.u = keypoint.x;
  o.v = keypoint.y;
  o.right_u = frame.right_u[observation.index];
  o.inverse_sigma2 = frame.scales->inverse_sigma2(keypoint.level);
  o.has_depth = observation.has_depth;
  auto kind = ObservationKind::kKeypoint;
  if (const auto* a = keyframe.aligned_at(observation.index, bundle.points[point])) {
    o.u = a->u;
    o.v = a->v;
    o.right_u = a->right_u;
    const bool right = a->right_variance > 0;
    o.inverse_sigma2 *= noise.position.weight();
    o.right_factor = (right ? noise.right.weight() : 1.0F) / noise.position.weight();
    kind = a->reference ? ObservationKind::kReference
           : right      ? ObservationKind::kAlignedRight
                        : ObservationKind::kAligned;
  }
  bundle.problem.observations.push_back(o);
  bundle.keypoints.push_back(observation.index);
  bundle.kinds.push_back(kind);
}

/// The reference sighting of the last added point is as exact as the sightings that were aligned to
/// it. Without such sightings it counts as a corner.
void weigh_reference(GatheredBundle& bundle, const NoiseFactors& noise) {
  auto& observations = bundle.problem.observations;
  const auto point = static_cast<std::uint32_t>(bundle.points.size() - 1);
  bool is_alone = true;
  BundleProblem::Observation* reference = nullptr;
  for (std::size_t i = observations.size(); i > 0 && observations[i - 1].point == point; --i) {
    const ObservationKind kind = bundle.kinds[i - 1];
    if (kind == ObservationKind::kReference) reference = &observations[i - 1];
    is_alone &= kind == ObservationKind::kReference || kind == ObservationKind::kKeypoint;
  }
  if (reference == nullptr || !is_alone) return;
  reference->inverse_sigma2 /= noise.position.weight();
  reference->right_factor = 1;
}

}  // namespace

void GatheredBundle::add_camera(const KeyFrame& keyframe, bool fixed) {
  camera_of.emplace(keyframe.id, static_cast<std::uint32_t>(keyframes.size()));
  keyframes.push_back(keyframe.id);
  problem.cameras.push_back({keyframe.T_cw, keyframe.frame->camera, fixed});
}

void GatheredBundle::add_point(const MapPoint& point, const Map& map) {
  const std::uint32_t slot = begin_point(*this, point);
  for (const orbslam::Observation& observation : point.observations) {
    const auto camera = camera_of.find(observation.keyframe);
    if (camera == camera_of.end()) continue;
    add_observation(*this, camera->second, slot, *map.find(observation.keyframe), observation,
                    map.noise());
  }
  weigh_reference(*this, map.noise());
}

void GatheredBundle::add_points(const std::vector<const MapPoint*>& added, const Map& map) {
  // By position in the list of cameras; observations and cameras come in thousands and tens.
  struct Place {
    std::uint32_t camera;
    const KeyFrame* keyframe;
  };
  std::vector<Place> by_id;
  const auto [first, last] = std::minmax_element(keyframes.begin(), keyframes.end());
  if (first == keyframes.end()) return;
  by_id.resize(static_cast<std::size_t>(last->value - first->value) + 1, {0, nullptr});
  const auto lowest = first->value;
  for (std::uint32_t i = 0; i < keyframes.size(); ++i) {
    by_id[static_cast<std::size_t>(keyframes[i].value - lowest)] = {i, map.find(keyframes[i])};
  }
  for (const MapPoint* point : added) {
    const std::uint32_t slot = begin_point(*this, *point);
    for (const orbslam::Observation& observation : point->observations) {
      const auto at = static_cast<std::size_t>(observation.keyframe.value - lowest);
      if (at >= by_id.size() || by_id[at].keyframe == nullptr) continue;  // lower ones wrap around
      add_observation(*this, by_id[at].camera, slot, *by_id[at].keyframe, observation, map.noise());
    }
    weigh_reference(*this, map.noise());
  }
}

int GatheredBundle::n_fixed() const {
  return static_cast<int>(std::count_if(problem.cameras.begin(), problem.cameras.end(),
                                        [](const auto& camera) { return camera.fixed; }));
}

void write_back(const GatheredBundle& bundle, Map& map) {
  for (std::size_t i = 0; i < bundle.keyframes.size(); ++i) {
    const BundleProblem::Camera& camera = bundle.problem.cameras[i];
    if (!camera.fixed && map.find(bundle.keyframes[i]) != nullptr) {
      map.set_pose(bundle.keyframes[i], camera.T_cw);
    }
  }
  for (std::size_t i = 0; i < bundle.points.size(); ++i) {
    if (map.find(bundle.points[i]) == nullptr) continue;
    map.set_position(bundle.points[i], bundle.problem.points[i]);
    map.update_geometry(bundle.points[i]);
  }
}

int erase_observations(const GatheredBundle& bundle, const std::vector<std::uint8_t>& flags,
                       Map& map) {
  int n_erased = 0;
  for (std::size_t i = 0; i < flags.size(); ++i) {
    if (flags[i] == 0) continue;
    const BundleProblem::Observation& o = bundle.problem.observations[i];
    const KeyFrameId keyframe = bundle.keyframes[o.camera];
    const MapPoint* point = map.find(bundle.points[o.point]);
    if (point == nullptr) continue;  // dead, maybe by an erasure just before
    const orbslam::Observation* observation = point->observation_of(keyframe);
    if (observation == nullptr || observation->index != bundle.keypoints[i]) continue;
    map.erase_observation(point->id, keyframe);
    ++n_erased;
  }
  return n_erased;
}

}  // namespace orbslam
