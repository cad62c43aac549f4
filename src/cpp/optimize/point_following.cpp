// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/point_following.hpp"

#include <algorithm>
#include <memory>
#include <unordered_map>

#include "base/errors.hpp"
#include "features/image_pyramid.hpp"
#include "optimize/patch_search.hpp"
#include "optimize/pose_optimization.hpp"

namespace orbslam {
namespace {

constexpr std::size_t kMostCoarse = 100;  ///< points that give the first pose
constexpr int kCoarser = 3;               ///< levels above that of the patch
constexpr double kCoarseCorrelation = 0.7;
constexpr int kFewest = 20;  ///< inliers of a pose

struct Source {
  MapPointId point;
  Eigen::Vector3d position;
  Descriptor descriptor;
  std::shared_ptr<const PointPatch> patch;
  PlacedPatch placed;  ///< refers to the patch
  float angle = 0;     ///< of the keypoint in the earlier frame
};

struct Found {
  const Source* source;
  FoundPatch place;
};

std::vector<Source> sources_of(const Map& map, const TrackedFrame& earlier) {
  std::vector<Source> sources;
  std::unordered_map<KeyFrameId, Pose> poses;
  const auto lock = map.read_lock();
  for (std::size_t i = 0; i < earlier.map_points.size(); ++i) {
    if (!earlier.map_points[i].valid() || earlier.outlier[i] != 0) continue;
    const MapPoint* point = map.find(earlier.map_points[i]);
    if (point == nullptr || !point->patch) continue;
    const auto [pose, is_new] = poses.try_emplace(point->patch->keyframe);
    if (is_new) pose->second = map.T_cw(point->patch->keyframe);
    const auto placed = place_patch(*point->patch, pose->second, point->position);
    if (!placed) continue;
    sources.push_back({point->id, point->position, point->descriptor, point->patch, *placed,
                       earlier.frame->keypoints[i].angle});
  }
  return sources;
}

/// The image as a frame without features, in which patches are searched.
Frame empty_frame(const FrameContext& context) {
  Frame frame;
  frame.camera = context.camera;
  frame.scales = context.scales;
  return frame;
}

std::size_t count_in_view(const std::vector<Source>& sources, const Camera& camera,
                          const Pose& T_cw) {
  const ImageSize size = camera.image_size();
  return static_cast<std::size_t>(std::count_if(sources.begin(), sources.end(), [&](const auto& s) {
    const auto warp = warp_of(s.placed.surface, camera, T_cw);
    return warp && warp->pixel.x() >= 0 && warp->pixel.y() >= 0 && warp->pixel.x() < size.width &&
           warp->pixel.y() < size.height;
  }));
}

/// `step`: only every `step`-th source is searched.
std::vector<Found> find_all(const std::vector<Source>& sources, std::size_t step,
                            const Frame& image, const Pose& T_cw, const ImagePyramid& pyramid,
                            const AlignmentOptions& options, int coarser) {
  std::vector<Found> found;
  found.reserve(sources.size() / step + 1);
  for (std::size_t i = 0; i < sources.size(); i += step) {
    const Source& s = sources[i];
    const auto warp = warp_of(s.placed.surface, *image.camera, T_cw);
    if (!warp) continue;
    const FoundPatch place =
        find_patch(s.placed, image, T_cw, pyramid, warp->pixel.cast<float>(), options, coarser);
    if (place.ok()) found.push_back({&s, place});
  }
  return found;
}

/// None when too few points agree.
std::optional<Pose> pose_of(const std::vector<Found>& found, const FrameContext& context,
                            const Pose& T_cw) {
  std::vector<PoseObservation> observations(found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    observations[i].position = found[i].source->position;
    observations[i].u = found[i].place.u;
    observations[i].v = found[i].place.v;
    observations[i].inverse_sigma2 = context.scales->inverse_sigma2(found[i].place.level);
  }
  const PoseEstimate pose = optimize_pose(T_cw, *context.camera, observations);
  if (pose.n_inliers < kFewest || 2 * static_cast<std::size_t>(pose.n_inliers) < found.size()) {
    return std::nullopt;
  }
  return pose.T_cw;
}

}  // namespace

FollowedPoints follow_points(const Map& map, const FrameContext& context,
                             const TrackedFrame& earlier, const Pose& T_cw, const cv::Mat& grey) {
  FollowedPoints followed;
  const std::vector<Source> sources = sources_of(map, earlier);
  followed.n_patches = sources.size();
  followed.extraction.pyramid = build_pyramid(grey, *context.scales);
  const ImagePyramid& pyramid = followed.extraction.pyramid;
  const Frame image = empty_frame(context);

  AlignmentOptions coarse;
  coarse.max_shift = AlignmentOptions::kMostShift;
  coarse.min_correlation = kCoarseCorrelation;
  const std::size_t step = std::max<std::size_t>(1, sources.size() / kMostCoarse);
  const std::vector<Found> some = find_all(sources, step, image, T_cw, pyramid, coarse, kCoarser);
  const auto first = pose_of(some, context, T_cw);
  if (!first) return followed;
  followed.n_in_view = count_in_view(sources, *context.camera, *first);
  const std::vector<Found> found = find_all(sources, 1, image, *first, pyramid, {}, 0);
  followed.T_cw = pose_of(found, context, *first);
  Features& features = followed.extraction.features;
  for (const Found& one : found) {
    Keypoint keypoint;
    const Eigen::Vector2f raw = one.place.raw;
    keypoint.x = raw.x();
    keypoint.y = raw.y();
    keypoint.level = one.place.level;
    keypoint.size = one.place.level_scale;
    keypoint.angle = one.source->angle;
    features.keypoints.push_back(keypoint);
    features.descriptors.push_back(one.source->descriptor);
    followed.points.push_back(one.source->point);
    followed.positions.push_back(one.source->position);
  }
  return followed;
}

void associate(const Map& map, TrackedFrame& frame, const FollowedPoints& followed) {
  const Frame& f = *frame.frame;
  if (f.size() != followed.points.size() || !followed.T_cw) {
    throw StateError("the frame was not built of the points that were followed");
  }
  const float weight = map.noise().position.weight();
  frame.T_cw = followed.T_cw;
  frame.aligned.assign(f.size(), AlignedPixel());
  for (std::size_t i = 0; i < f.size(); ++i) {
    frame.associate(i, followed.points[i], followed.positions[i]);
    AlignedPixel& pixel = frame.aligned[i];
    pixel.point = followed.points[i];
    pixel.u = f.keypoints[i].x;
    pixel.v = f.keypoints[i].y;
    pixel.right_u = f.right_u[i];
    pixel.inverse_sigma2 = weight * f.scales->inverse_sigma2(f.keypoints[i].level);
    pixel.right_factor = 1 / weight;
  }
}

}  // namespace orbslam
