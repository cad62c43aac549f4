// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/frame_alignment.hpp"

#include <algorithm>
#include <memory>
#include <unordered_map>
#include <vector>

#include "optimize/patch_search.hpp"

namespace orbslam {
namespace {

struct Sighting {
  std::size_t slot;
  std::shared_ptr<const PointPatch> patch;
  Pose T_rw;
};

/// Inliers whose point has a patch, a part of them where there are more than `most`.
std::vector<Sighting> sightings_of(const Map& map, const TrackedFrame& frame, std::size_t most) {
  std::vector<Sighting> all;
  const auto lock = map.read_lock();
  for (std::size_t i = 0; i < frame.map_points.size(); ++i) {
    if (!frame.map_points[i].valid() || frame.outlier[i] != 0) continue;
    const MapPoint* point = map.find(frame.map_points[i]);
    if (point != nullptr && point->patch) all.push_back({i, point->patch, Pose()});
  }
  std::vector<Sighting> chosen;
  const std::size_t n = std::min(most, all.size());
  chosen.reserve(n);
  std::unordered_map<KeyFrameId, Pose> poses;
  for (std::size_t k = 0; k < n; ++k) {
    Sighting& sighting = all[k * all.size() / n];
    const auto [pose, is_new] = poses.try_emplace(sighting.patch->keyframe);
    if (is_new) pose->second = map.T_cw(sighting.patch->keyframe);
    sighting.T_rw = pose->second;
    chosen.push_back(std::move(sighting));
  }
  return chosen;
}

}  // namespace

AlignmentCounts align_frame(const Map& map, TrackedFrame& frame, std::size_t most) {
  AlignmentCounts counts{};
  const Frame& f = *frame.frame;
  const auto images = f.images ? f.images->get() : nullptr;
  if (!images || !frame.T_cw) return counts;
  const std::vector<Sighting> sightings = sightings_of(map, frame, most);
  frame.aligned.assign(f.size(), AlignedPixel());
  const float weight = map.noise().position.weight();
  const float right_weight = map.noise().right.weight();
  for (const Sighting& s : sightings) {
    const auto placed = place_patch(*s.patch, s.T_rw, frame.positions[s.slot]);
    if (!placed) continue;
    const FoundPatch found =
        find_patch(*placed, f, *frame.T_cw, images->left, raw_pixel(f, s.slot));
    ++counts[static_cast<std::size_t>(found.failure)];
    if (!found.ok()) continue;
    const Keypoint& keypoint = f.keypoints[s.slot];
    AlignedPixel& pixel = frame.aligned[s.slot];
    pixel.point = frame.map_points[s.slot];
    pixel.u = found.u;
    pixel.v = found.v;
    pixel.right_u = f.right_u[s.slot] + (found.u - keypoint.x);
    pixel.inverse_sigma2 = weight * f.scales->inverse_sigma2(keypoint.level);
    const bool right = !f.right_variance.empty() && f.right_variance[s.slot] > 0;
    pixel.right_factor = (right ? right_weight : 1.0F) / weight;
  }
  return counts;
}

PoseEstimate optimize_aligned(const Map& map, TrackedFrame& frame, std::size_t most, int fewest) {
  PoseEstimate estimate = optimize_pose(frame);
  if (most == 0 || estimate.n_inliers < fewest) return estimate;
  align_frame(map, frame, most);
  return optimize_pose(frame);
}

}  // namespace orbslam
