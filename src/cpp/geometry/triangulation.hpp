// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>

#include "base/pose.hpp"

namespace orbslam {

/// Linear triangulation of two rays (of any length but 0): the world point whose algebraic error in
/// both cameras is least; nothing when it lies at infinity. See
/// docs/method/mapping.md#new-points.
std::optional<Eigen::Vector3d> triangulate(const Eigen::Vector3d& ray_1,
                                           const Eigen::Vector3d& ray_2, const Pose& T_1w,
                                           const Pose& T_2w);

/// F_12 with x_1^T F_12 x_2 = 0 for pixels of cameras with calibration matrices K_1 and K_2.
Eigen::Matrix3d fundamental_matrix(const Pose& T_1w, const Pose& T_2w, const Eigen::Matrix3d& K_1,
                                   const Eigen::Matrix3d& K_2);

}  // namespace orbslam
