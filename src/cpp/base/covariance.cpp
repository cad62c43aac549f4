// SPDX-License-Identifier: BSD-3-Clause
#include "base/covariance.hpp"

#include <algorithm>
#include <cmath>

namespace orbslam {

double position_deviation(const Matrix6d& covariance) {
  return std::sqrt(std::max(0.0, covariance(3, 3) + covariance(4, 4) + covariance(5, 5)));
}

Matrix6d widened_covariance(const Matrix6d& covariance, double factor,
                            const std::vector<Vector6d>& errors) {
  Matrix6d widened = factor * covariance;
  for (const Vector6d& error : errors) widened += error * error.transpose();
  return widened;
}

}  // namespace orbslam
