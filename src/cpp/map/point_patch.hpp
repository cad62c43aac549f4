// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>

#include "alignment/reference_patch.hpp"
#include "base/ids.hpp"
#include "base/scale_pyramid.hpp"
#include "camera/camera.hpp"

namespace orbslam {

/// The reference sighting of a map point: what its other sightings are aligned to. It holds no
/// length of the world, so that it stays true when the map moves. See
/// docs/method/alignment.md#references.
struct PointPatch {
  ReferencePatch patch;
  KeyFrameId keyframe;                              ///< living or culled
  std::shared_ptr<const Camera> camera;             ///< of that keyframe
  std::shared_ptr<const ScalePyramid> scales;       ///< of that keyframe
  int level = 0;                                    ///< of the image pyramid
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();  ///< raw
};

/// Where a keyframe sees a point by its patch, beside the keypoint, which stays where it is.
struct AlignedSighting {
  MapPointId point;          ///< the sighting of this point alone; invalid: nothing was tried
  float u = 0, v = 0;        ///< undistorted pixels
  float right_u = 0;         ///< column in the (virtual) right image
  float variance = 0;        ///< of u and of v, as the patch says [pixels^2]; 0: failed
  float right_variance = 0;  ///< of the right column; 0: it has the noise of the keypoint
  bool reference = false;    ///< the patch was cut here

  bool ok() const { return variance > 0; }
};

}  // namespace orbslam
