// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/triangulation.hpp"

#include <Eigen/SVD>
#include <cmath>

namespace orbslam {

std::optional<Eigen::Vector3d> triangulate(const Eigen::Vector3d& ray_1,
                                           const Eigen::Vector3d& ray_2, const Pose& T_1w,
                                           const Pose& T_2w) {
  const Eigen::Matrix<double, 3, 4> P_1 = T_1w.matrix().topRows<3>();
  const Eigen::Matrix<double, 3, 4> P_2 = T_2w.matrix().topRows<3>();
  Eigen::Matrix4d A;
  A.row(0) = ray_1.x() * P_1.row(2) - P_1.row(0);
  A.row(1) = ray_1.y() * P_1.row(2) - P_1.row(1);
  A.row(2) = ray_2.x() * P_2.row(2) - P_2.row(0);
  A.row(3) = ray_2.y() * P_2.row(2) - P_2.row(1);
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
