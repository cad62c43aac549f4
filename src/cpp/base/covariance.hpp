// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "base/pose.hpp"

namespace orbslam {

/// Standard deviation of the position by the covariance of a pose (rotation, translation), all
/// directions together; 0 where the sum of its variances is not positive.
double position_deviation(const Matrix6d& covariance);

/// `factor` times a covariance, plus that of independent errors, each given as a tangent (rotation,
/// translation) whose length is its standard deviation.
Matrix6d widened_covariance(const Matrix6d& covariance, double factor,
                            const std::vector<Vector6d>& errors);

}  // namespace orbslam
