// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/bundle_gather.hpp"

#include <algorithm>

namespace orbslam {

void GatheredBundle::add_camera(const KeyFrame& keyframe, bool fixed) {
  const Camera& camera = *keyframe.frame->camera;
  camera_of.emplace(keyframe.id, static_cast<std::uint32_t>(keyframes.size()));
  keyframes.push_back(keyframe.id);
  problem.cameras.push_back({keyframe.T_cw, camera.pinhole(), camera.bf(), fixed});
}

void GatheredBundle::add_point(const MapPoint& point, const Map& map) {
  const auto slot = static_cast<std::uint32_t>(points.size());
  points.push_back(point.id);
  problem.points.push_back(point.position);
  for (const orbslam::Observation& observation : point.observations) {
    const auto camera = camera_of.find(observation.keyframe);
    if (camera == camera_of.end()) continue;
    const Frame& frame = *map.find(observation.keyframe)->frame;
    const Keypoint& keypoint = frame.keypoints[observation.index];
    BundleProblem::Observation o;
    o.camera = camera->second;
    o.point = slot;
    o.u = keypoint.x;
    o.v = keypoint.y;
    o.right_u = frame.right_u[observation.index];
    o.inverse_sigma2 = frame.scales->inverse_sigma2(keypoint.level);
    o.has_depth = observation.has_depth;
    problem.observations.push_back(o);
    keypoints.push_back(observation.index);
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
