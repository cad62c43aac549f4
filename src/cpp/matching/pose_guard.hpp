// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "map/keyframe.hpp"

namespace orbslam {

/// Whether a keyframe still lives and has not moved since its pose was copied: results computed
/// from the copy are worthless otherwise. See docs/method/threads.md#locks.
inline bool stands_at(const KeyFrame* keyframe, const Pose& T_cw) {
  return keyframe && keyframe->T_cw.rotation().coeffs() == T_cw.rotation().coeffs() &&
         keyframe->T_cw.translation() == T_cw.translation();
}

}  // namespace orbslam
