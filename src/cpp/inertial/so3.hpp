// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "base/pose.hpp"

namespace orbslam {

/// The rotation of a rotation vector [rad], as a unit quaternion.
Eigen::Quaterniond so3_exp(const Eigen::Vector3d& omega);

/// The rotation vector [rad] of a unit quaternion; the angle is at most pi.
Eigen::Vector3d so3_log(const Eigen::Quaterniond& rotation);

/// Right Jacobian Jr of the exponential map: exp(omega + d) = exp(omega) exp(Jr d) to first order.
Eigen::Matrix3d so3_right_jacobian(const Eigen::Vector3d& omega);

/// Adjoint of a pose, for tangents (rotation, translation): T exp(d) = exp(adjoint(T) d) T.
Matrix6d adjoint(const Pose& T);

}  // namespace orbslam
