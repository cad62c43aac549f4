// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace orbslam {

/// The rotation of a rotation vector [rad], as a unit quaternion.
Eigen::Quaterniond so3_exp(const Eigen::Vector3d& omega);

/// The rotation vector [rad] of a unit quaternion; the angle is at most pi.
Eigen::Vector3d so3_log(const Eigen::Quaterniond& rotation);

/// Right Jacobian Jr of the exponential map: exp(omega + d) = exp(omega) exp(Jr d) to first order.
Eigen::Matrix3d so3_right_jacobian(const Eigen::Vector3d& omega);

}  // namespace orbslam
