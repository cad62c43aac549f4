// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace orbslam {

/// A motion from view 1 to view 2 up to scale: p_2 = R p_1 + t, |t| = 1.
struct Motion {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
};

/// The eight motions that a homography H_21 of pixels allows (Faugeras and Lustman 1988): four
/// with both cameras on the same side of the plane, then four on opposite sides. None when two
/// singular values agree to 1e-5: the motion is a rotation or the plane is not determined. See
/// docs/method/start.md#choosing-the-motion.
std::vector<Motion> motions_from_homography(const Eigen::Matrix3d& H_21, const Eigen::Matrix3d& K);

/// The four motions (R_a, t), (R_b, t), (R_a, -t), (R_b, -t) of a fundamental matrix F_21 of
/// pixels.
std::vector<Motion> motions_from_fundamental(const Eigen::Matrix3d& F_21, const Eigen::Matrix3d& K);

}  // namespace orbslam
