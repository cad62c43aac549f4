// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "geometry/two_view_outcome.hpp"

namespace orbslam {

/// Support of one motion hypothesis (see MotionSupport).
struct MotionScore {
  std::size_t n_good = 0;
  double parallax = 0;  ///< degrees
};

struct MotionLimits {
  std::size_t min_points = 50;
  double min_parallax = 1.0;  ///< degrees
};

struct MotionChoice {
  TwoViewOutcome outcome = TwoViewOutcome::too_few_points;
  std::size_t index = 0;  ///< of the hypothesis with the most good points, first of equals
};

/// Accepts the best of a homography's motions when it has more than min_points good points and
/// more than 90 % of `n_inliers`, at least min_parallax, and the second best has fewer than 75 %
/// of its points. `scores` must not be empty. See docs/method/start.md#choosing-the-motion.
MotionChoice choose_homography_motion(const std::vector<MotionScore>& scores, std::size_t n_inliers,
                                      const MotionLimits& limits);

/// Accepts the best of a fundamental matrix' motions when it has at least min_points good points
/// and at least 90 % of `n_inliers` (rounded down), more than min_parallax, and no other has more
/// than 70 % of its points. `scores` must not be empty.
MotionChoice choose_fundamental_motion(const std::vector<MotionScore>& scores,
                                       std::size_t n_inliers, const MotionLimits& limits);

}  // namespace orbslam
