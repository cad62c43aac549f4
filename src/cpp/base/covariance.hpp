// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "base/pose.hpp"

namespace orbslam {

/// Standard deviation of the position by the covariance of a pose (rotation, translation), all
/// directions together; 0 for one whose variances are not positive.
double position_deviation(const Matrix6d& covariance);

/// A covariance of `factor` times the variances, and of independent errors along tangents
/// (rotation, translation) as long as their standard deviations.
Matrix6d widened_covariance(const Matrix6d& covariance, double factor,
                            const std::vector<Vector6d>& errors);

}  // namespace orbslam
