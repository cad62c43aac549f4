// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace orbslam {

/// Whether two views gave a reconstruction, or why not. See
/// docs/method/start.md#choosing-the-motion.
enum class TwoViewOutcome {
  reconstructed,
  too_few_matches,    ///< fewer than TwoViewOptions::min_matches
  degenerate_points,  ///< the keypoints of a view lie on one row or column
  no_model,           ///< no sample gave a model that explains anything
  degenerate_plane,   ///< homography chosen, but it may be a pure rotation
  too_few_points,     ///< the best motion places too few of the inliers
  low_parallax,       ///< the views are too close together for the scene's distance
  ambiguous_motion,   ///< a second motion explains the matches nearly as well
};

/// In snake case, for logs and messages.
const char* to_string(TwoViewOutcome outcome);

}  // namespace orbslam
