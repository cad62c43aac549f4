// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace orbslam {

/// Left Jacobian J of SO(3) at a rotation vector w [rad]: exp(w + d) = exp(J d) exp(w) to first
/// order in d. See docs/method/adjustment.md#residuals.
Eigen::Matrix3d rotation_left_jacobian(const Eigen::Vector3d& w);

}  // namespace orbslam
