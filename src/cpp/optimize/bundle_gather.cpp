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

/// Inverse variance of an aligned position, which is never taken for worse than a corner.
float aligned_weight(double factor, float variance, float corner_weight) {
  const double weight = 1 / (factor * factor * static_cast<double>(variance));
  return std::max(corner_weight, static_cast<float>(weight));
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
  const float corner = o.inverse_sigma2;
  if (const auto* a = keyframe.aligned_at(observation.index, bundle.points[point])) {
    o.u = a->u;
    o.v = a->v;
    o.right_u = a->right_u;
    o.inverse_sigma2 = aligned_weight(noise.position.value(), a->variance, corner);
    const bool right = a->right_variance > 0;
    const float right_weight =
        right ? aligned_weight(noise.right.value(), a->right_variance, corner) : corner;
    o.right_factor = right_weight / o.inverse_sigma2;
    kind = a->reference ? ObservationKind::kReference
           : right      ? ObservationKind::kAlignedRight
                        : ObservationKind::kAligned;
  }
  bundle.problem.observations.push_back(o);
  bundle.keypoints.push_back(observation.index);
  bundle.kinds.push_back(kind);
}

/// Gives the reference sighting of the point that was added last the mean weight of those that were
/// aligned to it: it is as exact as they are. Without any its corner counts as one.
void weigh_reference(GatheredBundle& bundle, const Map& map) {
  auto& observations = bundle.problem.observations;
  const std::uint32_t point = static_cast<std::uint32_t>(bundle.points.size() - 1);
  float sum = 0;
  int n = 0;
  BundleProblem::Observation* reference = nullptr;
  std::size_t i = observations.size();
  for (; i > 0 && observations[i - 1].point == point; --i) {
    auto& o = observations[i - 1];
    if (bundle.kinds[i - 1] == ObservationKind::kReference) {
      reference = &o;
    } else if (bundle.kinds[i - 1] != ObservationKind::kKeypoint) {
      sum += o.inverse_sigma2;
      ++n;
    }
  }
  if (reference == nullptr) return;
  const std::size_t at = static_cast<std::size_t>(reference - observations.data());
  const Frame& frame = *map.find(bundle.keyframes[reference->camera])->frame;
  const float corner = frame.scales->inverse_sigma2(frame.keypoints[bundle.keypoints[at]].level);
  const float right = reference->right_factor * reference->inverse_sigma2;
  reference->inverse_sigma2 = n > 0 ? std::max(corner, sum / static_cast<float>(n)) : corner;
  reference->right_factor = n > 0 ? right / reference->inverse_sigma2 : 1.0F;
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
  weigh_reference(*this, map);
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
    weigh_reference(*this, map);
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
