// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/frame_sightings.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <optional>
#include <utility>

#include "optimize/pose_optimization.hpp"

namespace orbslam {
namespace {

constexpr std::size_t kFewestSightings = 20;
constexpr double kInlierShare = 0.5;
constexpr double kOtherPose = 12.592;  // 95 % of chi-square, six degrees of freedom

/// Whether the points say clearly that the frame is elsewhere. What is within the noise of its
/// keypoints it shares with its neighbours as it was recorded, and alone if it is estimated anew.
bool is_elsewhere(const Pose& recorded, const PoseEstimate& estimate) {
  const Vector6d change = (estimate.T_cw * recorded.inverse()).log();
  const Eigen::LDLT<Matrix6d> factor(estimate.covariance);
  return factor.info() == Eigen::Success && change.dot(factor.solve(change)) > kOtherPose;
}

/// Whether the frame is a living keyframe: it is recorded relative to itself.
bool is_keyframe(const Map& map, const TrajectoryRecorder& recorder, FrameId frame) {
  const KeyFrame* reference = map.find(recorder.reference(frame));
  return reference != nullptr && reference->frame->id == frame;
}

}  // namespace

void FrameSightings::keep(const TrackedFrame& frame) {
  const Frame& f = *frame.frame;
  Sightings sightings{f.camera, {}};
  if (frame.T_cw) {
    for (std::size_t i = 0; i < f.size(); ++i) {
      if (!frame.map_points[i].valid() || frame.outlier[i] != 0) continue;
      const Keypoint& keypoint = f.keypoints[i];
      const auto weight = static_cast<float>(f.scales->inverse_sigma2(keypoint.level));
      sightings.seen.push_back(
          {frame.map_points[i], keypoint.x, keypoint.y, f.right_u[i], weight, f.has_depth(i)});
    }
  }
  if (sightings.seen.size() < kFewestSightings) return forget(f.id);
  sightings.seen.shrink_to_fit();
  frames_[f.id] = std::move(sightings);
}

int FrameSightings::settle(const Map& map, TrajectoryRecorder& recorder, std::size_t n_youngest) {
  int n_settled = 0;
  while (frames_.size() > n_youngest) {
    const auto oldest = frames_.begin();
    if (settle_one(map, recorder, oldest->first, oldest->second)) {
      ++n_settled;
    }
    frames_.erase(oldest);
  }
  return n_settled;
}

bool FrameSightings::settle_one(const Map& map, TrajectoryRecorder& recorder, FrameId frame,
                                const Sightings& sightings) {
  const auto lock = map.read_lock();
  const std::optional<Pose> T_cw = recorder.T_cw(map, frame);
  if (!T_cw || is_keyframe(map, recorder, frame)) return false;
  std::vector<PoseObservation> observations;
  observations.reserve(sightings.seen.size());
  for (const Sighting& s : sightings.seen) {
    const MapPoint* point = map.find(map.resolve(s.point));
    if (point == nullptr) continue;
    observations.push_back({point->position, s.u, s.v, s.right_u, s.inverse_sigma2, s.has_depth});
  }
  const auto enough = std::max(static_cast<double>(kFewestSightings),
                               kInlierShare * static_cast<double>(sightings.seen.size()));
  if (static_cast<double>(observations.size()) < enough) return false;
  const Camera& camera = *sightings.camera;
  const PoseEstimate estimate = optimize_pose(*T_cw, camera.pinhole(), camera.bf(), observations);
  if (estimate.n_inliers < enough || !is_elsewhere(*T_cw, estimate)) return false;
  recorder.move(map, frame, estimate.T_cw);
  return true;
}

}  // namespace orbslam
