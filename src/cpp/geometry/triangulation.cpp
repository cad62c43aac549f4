// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/triangulation.hpp"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <cmath>

namespace orbslam {
namespace {

/// Two directions orthogonal to a ray. At z = 1 they are those of the image plane.
Eigen::Matrix<double, 2, 3> orthogonal_to(const Eigen::Vector3d& ray) {
  Eigen::Matrix<double, 2, 3> rows;
  constexpr double kSteepest = 0.3;  // cosine to the axis from which on z is divided by
  if (ray.z() == 1.0 || ray.z() > kSteepest * ray.norm()) {
    rows << -1, 0, ray.x() / ray.z(), 0, -1, ray.y() / ray.z();
    return rows;
  }
  const Eigen::Vector3d first = ray.unitOrthogonal();
  rows << first.transpose(), ray.normalized().cross(first).transpose();
  return rows;
}

}  // namespace

std::optional<Eigen::Vector3d> triangulate(const Eigen::Vector3d& ray_1,
                                           const Eigen::Vector3d& ray_2, const Pose& T_1w,
                                           const Pose& T_2w) {
  const Eigen::Matrix<double, 3, 4> P_1 = T_1w.matrix().topRows<3>();
  const Eigen::Matrix<double, 3, 4> P_2 = T_2w.matrix().topRows<3>();
  Eigen::Matrix4d A;
  A.topRows<2>() = orthogonal_to(ray_1) * P_1;
  A.bottomRows<2>() = orthogonal_to(ray_2) * P_2;
  const Eigen::JacobiSVD<Eigen::Matrix4d> svd(A, Eigen::ComputeFullV);
  const Eigen::Vector4d point = svd.matrixV().col(3);
  if (point.w() == 0.0) return std::nullopt;
  const Eigen::Vector3d position = point.head<3>() / point.w();
  if (!position.allFinite()) return std::nullopt;
  return position;
}

Eigen::Matrix3d fundamental_matrix(const Pose& T_1w, const Pose& T_2w, const Eigen::Matrix3d& K_1,
                                   const Eigen::Matrix3d& K_2) {
  const Pose T_12 = T_1w * T_2w.inverse();
  const Eigen::Matrix3d essential = skew(T_12.translation()) * T_12.rotation_matrix();
  return K_1.inverse().transpose() * essential * K_2.inverse();
}

}  // namespace orbslam
