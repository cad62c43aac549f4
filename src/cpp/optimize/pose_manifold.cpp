// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/pose_manifold.hpp"

namespace orbslam {

Pose pose_from_block(const double* block) {
  const Eigen::Map<const Eigen::Vector3d> translation(block + 4);
  return Pose(Eigen::Quaterniond(block[3], block[0], block[1], block[2]), translation);
}

void pose_to_block(const Pose& pose, double* block) {
  Eigen::Map<Eigen::Vector4d>{block} = pose.rotation().coeffs();
  Eigen::Map<Eigen::Vector3d>{block + 4} = pose.translation();
}

bool PoseManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  const Eigen::Map<const Vector6d> xi(delta);
  pose_to_block(Pose::exp(xi) * pose_from_block(x), x_plus_delta);
  return true;
}

bool PoseManifold::PlusJacobian(const double*, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, kAmbientSize, kTangentSize, Eigen::RowMajor>>{jacobian}
      .setIdentity();
  return true;
}

bool PoseManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  Eigen::Map<Vector6d>{y_minus_x} = (pose_from_block(y) * pose_from_block(x).inverse()).log();
  return true;
}

bool PoseManifold::MinusJacobian(const double*, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, kTangentSize, kAmbientSize, Eigen::RowMajor>>{jacobian}
      .setIdentity();
  return true;
}

}  // namespace orbslam
