// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace orbslam {

/// Pinhole intrinsics in pixels, by which a Camera projects. Algorithms that hold for a pinhole
/// alone (linear equations in pixels, kernels on the plane at unit depth) take them from a Camera.
struct Pinhole {
  double fx = 0, fy = 0, cx = 0, cy = 0;

  /// (u, v) of a point in the camera frame; its z must not be 0.
  Eigen::Vector2d project(const Eigen::Vector3d& p_c) const {
    const double inverse_z = 1.0 / p_c.z();
    return {fx * p_c.x() * inverse_z + cx, fy * p_c.y() * inverse_z + cy};
  }
  /// The calibration matrix K.
  Eigen::Matrix3d matrix() const {
    Eigen::Matrix3d K;
    K << fx, 0, cx, 0, fy, cy, 0, 0, 1;
    return K;
  }
  /// The point at depth z [m] seen at pixel (u, v).
  Eigen::Vector3d unproject(double u, double v, double z) const {
    return {(u - cx) * z / fx, (v - cy) * z / fy, z};
  }
  /// Pixel of a point of the plane at unit depth.
  Eigen::Vector2d to_pixel(const Eigen::Vector2d& m) const {
    return {fx * m.x() + cx, fy * m.y() + cy};
  }
  /// The point of the plane at unit depth at a pixel.
  Eigen::Vector2d to_plane(const Eigen::Vector2d& uv) const {
    return {(uv.x() - cx) / fx, (uv.y() - cy) / fy};
  }
};

/// The pixel of a point, and its derivative by the point.
struct Seen {
  Eigen::Vector2d uv;             ///< pixel; of a Camera: undistorted, of a CameraModel: raw
  Eigen::Matrix<double, 2, 3> J;  ///< d uv / d p_c
};

}  // namespace orbslam
