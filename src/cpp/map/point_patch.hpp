// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>

#include "alignment/reference_patch.hpp"
#include "base/ids.hpp"
#include "base/scale_pyramid.hpp"
#include "camera/camera.hpp"

namespace orbslam {

/// The reference sighting of a map point, to which its other sightings are aligned. It holds no
/// length of the world, so it stays valid when the map moves. See
/// docs/method/alignment.md#references.
struct PointPatch {
  ReferencePatch patch;
  KeyFrameId keyframe;                              ///< living or culled
  std::shared_ptr<const Camera> camera;             ///< of that keyframe
  std::shared_ptr<const ScalePyramid> scales;       ///< of that keyframe
  int level = 0;                                    ///< of the image pyramid
  Eigen::Vector2f pixel = Eigen::Vector2f::Zero();  ///< raw
};

/// Pixel of a point in a keyframe, found by alignment of its patch. The keypoint itself does not
/// change.
struct AlignedSighting {
  MapPointId point;          ///< the entry is for this point; invalid: not tried
  float u = 0, v = 0;        ///< undistorted pixels
  float right_u = 0;         ///< column in the (virtual) right image
  float variance = 0;        ///< of u and of v, by the patch [pixels^2]; 0: failed
  float right_variance = 0;  ///< of the right column; 0: it has the noise of the keypoint
  bool reference = false;    ///< the patch was cut here

  bool ok() const { return variance > 0; }
};

}  // namespace orbslam
