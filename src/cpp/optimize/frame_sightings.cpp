// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/frame_sightings.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cstddef>
#include <iterator>
#include <utility>

#include "base/parallel.hpp"
#include "optimize/pose_optimization.hpp"

namespace orbslam {
namespace {

constexpr std::size_t kFewestSightings = 20;
constexpr double kInlierShare = 0.5;
constexpr double kOtherPose = 12.592;  // 95 % of chi-square, six degrees of freedom

/// Whether the new pose differs significantly from the recorded one. A recorded pose shares its
/// error with its neighbours. A new estimate within the noise of the keypoints would only add an
/// error of its own.
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
      Sighting seen{frame.map_points[i], keypoint.x, keypoint.y, f.right_u[i], weight, 1,
                    f.has_depth(i)};
      if (const AlignedPixel* a = frame.aligned_at(i)) {
        seen = {seen.point,      a->u,          a->v, a->right_u, a->inverse_sigma2,
                a->right_factor, seen.has_depth};
      }
      sightings.seen.push_back(seen);
    }
  }
  if (sightings.seen.size() < kFewestSightings) return forget(f.id);
  sightings.seen.shrink_to_fit();
  frames_[f.id] = std::move(sightings);
}

int FrameSightings::settle(const Map& map, TrajectoryRecorder& recorder, std::size_t n_youngest) {
  if (frames_.size() <= n_youngest) return 0;
  const auto end =
      std::next(frames_.begin(), static_cast<std::ptrdiff_t>(frames_.size() - n_youngest));
  struct Task {
    FrameId frame;
    const Sightings* sightings;
    std::optional<Pose> T_cw;
  };
  std::vector<Task> tasks;
  for (auto it = frames_.begin(); it != end; ++it) tasks.push_back({it->first, &it->second, {}});
  for_each_in_parallel(tasks.size(), threads_for(tasks.size()), [&](std::size_t i) {
    tasks[i].T_cw = settled_pose(map, recorder, tasks[i].frame, *tasks[i].sightings);
  });
  int n_settled = 0;
  {
    const auto lock = map.read_lock();
    for (const Task& task : tasks) {
      if (!task.T_cw) continue;
      recorder.move(map, task.frame, *task.T_cw);
      ++n_settled;
    }
  }
  frames_.erase(frames_.begin(), end);
  return n_settled;
}

/// None if the pose should not change.
std::optional<Pose> FrameSightings::settled_pose(const Map& map, const TrajectoryRecorder& recorder,
                                                 FrameId frame, const Sightings& sightings) {
  std::optional<Pose> T_cw;
  std::vector<PoseObservation> observations;
  {
    const auto lock = map.read_lock();
    T_cw = recorder.T_cw(map, frame);
    if (!T_cw || is_keyframe(map, recorder, frame)) return std::nullopt;
    observations.reserve(sightings.seen.size());
    for (const Sighting& s : sightings.seen) {
      const MapPoint* point = map.find(map.resolve(s.point));
      if (point == nullptr) continue;
      observations.push_back(
          {point->position, s.u, s.v, s.right_u, s.inverse_sigma2, s.has_depth, s.right_factor});
    }
  }
  const auto enough = std::max(static_cast<double>(kFewestSightings),
                               kInlierShare * static_cast<double>(sightings.seen.size()));
  if (static_cast<double>(observations.size()) < enough) return std::nullopt;
  const PoseEstimate estimate = optimize_pose(*T_cw, *sightings.camera, observations);
  if (estimate.n_inliers < enough || !is_elsewhere(*T_cw, estimate)) return std::nullopt;
  return estimate.T_cw;
}

}  // namespace orbslam
