// SPDX-License-Identifier: BSD-3-Clause
#include "inertial/imu_residual.hpp"

#include <Eigen/Dense>

#include "inertial/so3.hpp"

namespace orbslam {

ImuResidual imu_residual(const Preintegration& motion, const ImuState& first, const ImuBias& bias,
                         const ImuState& second, const Eigen::Vector3d& gravity) {
  const double dt = motion.duration();
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d R_bw = first.T_wb.rotation_matrix().transpose();
  const Eigen::Matrix3d R_wb2 = second.T_wb.rotation_matrix();
  Vector6d change;
  change << bias.gyro - motion.bias().gyro, bias.accel - motion.bias().accel;
  const Vector9d by_change = motion.by_bias() * change;
  const Eigen::Vector3d turned = by_change.head<3>();
  const Eigen::Quaterniond dR = (motion.motion().dR * so3_exp(turned)).normalized();

  const Eigen::Quaterniond between = first.T_wb.rotation().conjugate() * second.T_wb.rotation();
  const Eigen::Vector3d dv = R_bw * (second.velocity - first.velocity - dt * gravity);
  const Eigen::Vector3d dp = R_bw * (second.T_wb.translation() - first.T_wb.translation() -
                                     dt * first.velocity - 0.5 * dt * dt * gravity);
  ImuResidual result;
  const Eigen::Vector3d rotation = so3_log((dR.conjugate() * between).normalized());
  result.error << rotation, dv - motion.motion().dv - by_change.segment<3>(3),
      dp - motion.motion().dp - by_change.tail<3>();

  const Eigen::Matrix3d J = so3_right_jacobian(rotation).inverse();
  result.by_first.setZero();
  result.by_first.block<3, 3>(0, 0) = -J * (R_wb2.transpose() * R_bw.transpose());
  result.by_first.block<3, 3>(3, 0) = skew(dv);
  result.by_first.block<3, 3>(3, 3) = -R_bw;
  result.by_first.block<3, 3>(6, 0) = skew(dp);
  result.by_first.block<3, 3>(6, 3) = -dt * R_bw;
  result.by_first.block<3, 3>(6, 6) = -R_bw;
  result.by_second.setZero();
  result.by_second.block<3, 3>(0, 0) = J;
  result.by_second.block<3, 3>(3, 3) = R_bw;
  result.by_second.block<3, 3>(6, 6) = R_bw;
  result.by_bias = -motion.by_bias();
  const Eigen::Matrix3d by_turned =
      J * so3_exp(rotation).conjugate().toRotationMatrix() * so3_right_jacobian(turned);
  result.by_bias.topRows<3>() = -by_turned * motion.by_bias().topRows<3>();
  result.by_gravity << 0 * I, -dt * R_bw, -0.5 * dt * dt * R_bw;
  return result;
}

}  // namespace orbslam
