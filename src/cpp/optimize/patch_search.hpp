// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>

#include "alignment/align_patch.hpp"
#include "alignment/patch_warp.hpp"
#include "features/image_pyramid.hpp"
#include "frame/frame.hpp"
#include "map/point_patch.hpp"

namespace orbslam {

/// A patch and its surface.
struct PlacedPatch {
  const ReferencePatch* patch;
  const Camera* camera;        ///< of the reference
  const ScalePyramid* scales;  ///< of the reference
  int level;                   ///< of the reference
  SurfacePatch surface;
};

struct FoundPatch {
  AlignmentFailure failure = AlignmentFailure::kOutside;
  float u = 0, v = 0;                             ///< undistorted pixels
  float variance = 0;                             ///< of u and of v, mean of both [pixels^2]
  float level_scale = 1;                          ///< pixels per pixel of the level
  int level = 0;                                  ///< of the image in which it was aligned
  Eigen::Vector2f raw = Eigen::Vector2f::Zero();  ///< pixel of the image

  bool ok() const { return failure == AlignmentFailure::kNone; }
};

/// The patch of a point at `position`, on the surface that its reference camera at `T_rw` sees. It
/// refers to `patch`. None when the point is not in front of that camera.
std::optional<PlacedPatch> place_patch(const PointPatch& patch, const Pose& T_rw,
                                       const Eigen::Vector3d& position);

/// Warps a patch into an image of `frame`, seen from `T_cw`, and aligns it from the raw pixel
/// `start` on, `coarser` levels above the one that shows it as large as the reference. Nothing is
/// allocated. See docs/method/alignment.md#warp.
FoundPatch find_patch(const PlacedPatch& placed, const Frame& frame, const Pose& T_cw,
                      const ImagePyramid& images, const Eigen::Vector2f& start,
                      const AlignmentOptions& options = {}, int coarser = 0);

/// Raw pixel of a keypoint.
inline Eigen::Vector2f raw_pixel(const Frame& frame, std::size_t i) {
  const auto& keypoints = frame.raw_keypoints.empty() ? frame.keypoints : frame.raw_keypoints;
  return {keypoints[i].x, keypoints[i].y};
}

/// Cuts the patch at keypoint i out of the image pyramid. False when it is too near to the border.
bool cut_patch_at(const Frame& frame, std::size_t i, const ImagePyramid& images,
                  ReferencePatch& patch);

}  // namespace orbslam
