// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>

#include "base/similarity.hpp"

namespace orbslam {

/// The similarity S_12 with the least sum of squares |p_1 - S_12 p_2|^2 over corresponding points
/// (3 x n each, n >= 3), in closed form by unit quaternions (Horn 1987). Errors are attributed to
/// set 1: the scale is not the inverse of the one from exchanged sets. `fix_scale`: scale 1.
/// Nothing when either set is collinear, a number is not finite or no positive scale fits.
/// Throws std::invalid_argument for fewer than 3 points or different counts. See
/// docs/method/loops.md#verification.
std::optional<Similarity> align_similarity(const Eigen::Ref<const Eigen::Matrix3Xd>& points_1,
                                           const Eigen::Ref<const Eigen::Matrix3Xd>& points_2,
                                           bool fix_scale);

}  // namespace orbslam
