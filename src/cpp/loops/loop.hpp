// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "base/ids.hpp"
#include "base/similarity.hpp"

namespace orbslam {

/// A place seen again: the present keyframe, the earlier keyframe of that place, and the similarity
/// between their cameras. The similarity measures the drift since then. See
/// docs/method/loops.md#verification.
struct Loop {
  KeyFrameId current, matched;
  Similarity S_cm;                      ///< camera of `matched` to camera of `current`
  Similarity S_cw;                      ///< world to `current` once corrected: S_cm * S_mw
  std::vector<MapPointId> matches;      ///< per keypoint of `current`: far-side point or invalid
  std::vector<MapPointId> loop_points;  ///< all points around `matched`, each once
  int n_inliers = 0;                    ///< points of both keyframes that agree with S_cm
  int n_matches = 0;                    ///< valid entries of `matches`
};

}  // namespace orbslam
