// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>

#include "base/pose.hpp"
#include "base/scale_pyramid.hpp"
#include "camera/camera.hpp"

namespace orbslam {

/// The piece of a surface that a reference camera sees around one of its pixels: a plane.
struct SurfacePatch {
  Eigen::Vector3d point;                  ///< world, seen at the pixel
  Eigen::Matrix<double, 3, 2> per_pixel;  ///< derivative of the point by the pixel (u, v)
};

/// The plane through the point at depth `z` [m] behind `pixel`, parallel to the image plane, or for
/// a fisheye lens across the ray: the assumption while the normal is not known. `pixel` is raw: of
/// the image, not of the undistorted plane. None when a number is not finite or `z` is not above 0.
std::optional<SurfacePatch> parallel_patch(const Camera& camera, const Pose& T_wc,
                                           const Eigen::Vector2d& pixel, double z);

/// Where another camera sees a surface patch, and the affine map from pixels around the reference
/// pixel to pixels around there. Pixels are raw.
struct PatchWarp {
  Eigen::Vector2d pixel;
  Eigen::Matrix2d A;
};

/// None when the camera does not see the point, or sees the plane edge-on.
std::optional<PatchWarp> warp_of(const SurfacePatch& patch, const Camera& camera, const Pose& T_cw);

/// The level of the other image in which the patch is as large as in the reference's level: of the
/// scale nearest to that of the reference times the magnification, limited to the pyramid.
int warped_level(const ScalePyramid& scales, int reference_level, const Eigen::Matrix2d& A);

}  // namespace orbslam
