// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>

#include "base/pose.hpp"
#include "camera/camera.hpp"

namespace orbslam {

struct EpnpPose {
  Pose T_cw;
  double mean_error = 0;  ///< mean reprojection error of the points given [pixels]
};

/// Pose of a camera from n >= 4 points, world coordinates (3 x n) and undistorted pixels (2 x n),
/// with a cost linear in n (Lepetit, Moreno-Noguer and Fua 2009). No outliers are looked for and
/// no depth is asked to be positive. Nothing when the points are collinear or not finite. Points
/// on a plane are expressed by three control points instead of four. The camera must not be a rig.
/// Throws std::invalid_argument for fewer than 4 points or different counts. See
/// docs/method/relocalization.md#pose-from-points.
std::optional<EpnpPose> solve_epnp(const Eigen::Ref<const Eigen::Matrix3Xd>& points,
                                   const Eigen::Ref<const Eigen::Matrix2Xd>& pixels,
                                   const Camera& camera);

}  // namespace orbslam
