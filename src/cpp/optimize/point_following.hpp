// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "base/ids.hpp"
#include "features/orb_extractor.hpp"
#include "frame/build_frame.hpp"
#include "frame/frame.hpp"
#include "map/map.hpp"

namespace orbslam {

/// Points of an earlier frame, found in another image by their patches.
struct FollowedPoints {
  /// One keypoint a point, raw, with the point's descriptor; and the pyramid of the image.
  Extraction extraction;
  std::vector<MapPointId> points;          ///< of the keypoints
  std::vector<Eigen::Vector3d> positions;  ///< of the points, world
  std::optional<Pose> T_cw;                ///< none: too few were found
  std::size_t n_patches = 0;               ///< inliers of the earlier frame that have a patch
  std::size_t n_in_view = 0;               ///< of these, points that the pose puts into the image
};

/// Searches the inliers of `earlier` in a grey image by their patches, without features. First a
/// part of them is searched on coarser levels around the predicted pose `T_cw`. Then all are
/// searched around the pose from this part. Takes the read lock for a short section. See
/// docs/method/alignment.md#frames-without-features.
FollowedPoints follow_points(const Map& map, const FrameContext& context,
                             const TrackedFrame& earlier, const Pose& T_cw, const cv::Mat& grey);

/// Associates a frame that was built of these features with their points, with the noise of aligned
/// sightings, and gives it their pose. Throws StateError when the
/// frame has other keypoints, or the points have no pose.
void associate(const Map& map, TrackedFrame& frame, const FollowedPoints& followed);

}  // namespace orbslam
