// SPDX-License-Identifier: BSD-3-Clause
#include "inertial/inertial_filter.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "inertial/small_product.hpp"
#include "inertial/so3.hpp"

namespace orbslam {
namespace {

template <class Matrix>
void make_symmetric(Matrix& m) {
  m = (0.5 * (m + m.transpose())).eval();
}

}  // namespace

InertialFilter::InertialFilter(const Pose& T_cb, const ImuNoise& noise, const ImuState& state,
                               const ImuBias& bias, const Covariance& covariance)
    : T_cb_(T_cb),
      T_bc_(T_cb.inverse()),
      noise_(noise),
      state_(state),
      bias_(bias),
      covariance_(covariance) {}

Eigen::Vector3d InertialFilter::gravity() const {
  return so3_exp({tilt_.x(), tilt_.y(), 0}) * Eigen::Vector3d(0, 0, -kGravity);
}

void InertialFilter::predict(const std::vector<ImuSample>& samples, double scale_walk,
                             double rotation_walk) {
  const Preintegration motion(samples, noise_, bias_);
  const double dt = motion.duration(), factor = std::exp(log_scale_);
  const Eigen::Matrix3d R = state_.T_wb.rotation_matrix();
  const Eigen::Matrix3d dR = motion.motion().dR.toRotationMatrix();
  const Eigen::Vector3d g = gravity();
  const Eigen::Vector3d dv = motion.motion().dv, dp = motion.motion().dp;
  const Eigen::Vector3d faster = factor * (dt * g + R * dv);
  const Eigen::Vector3d further = factor * (0.5 * dt * dt * g + R * dp);
  // Of gravity by its tilt: the cross product of the axis and gravity.
  const Eigen::Matrix<double, 3, 2> by_tilt = -skew(g).leftCols<2>();

  Covariance F = Covariance::Identity();
  F.block<3, 3>(kRotation, kRotation) = dR.transpose();
  F.block<3, 3>(kVelocity, kRotation) = -factor * R * skew(dv);
  F.block<3, 3>(kPosition, kRotation) = -factor * R * skew(dp);
  F.block<3, 3>(kPosition, kVelocity) = dt * Eigen::Matrix3d::Identity();
  F.block<3, 6>(kRotation, kGyro) = motion.by_bias().topRows<3>();
  F.block<3, 6>(kVelocity, kGyro) = factor * R * motion.by_bias().middleRows<3>(3);
  F.block<3, 6>(kPosition, kGyro) = factor * R * motion.by_bias().bottomRows<3>();
  F.block<3, 2>(kVelocity, kTilt) = factor * dt * by_tilt;
  F.block<3, 2>(kPosition, kTilt) = factor * 0.5 * dt * dt * by_tilt;
  F.block<3, 1>(kVelocity, kScale) = faster;
  F.block<3, 1>(kPosition, kScale) = further;

  Matrix9d to_world = Matrix9d::Identity();
  to_world.block<3, 3>(3, 3) = to_world.block<3, 3>(6, 6) = factor * R;
  covariance_ = transported(F, covariance_);
  covariance_.topLeftCorner<9, 9>() += transported(to_world, motion.covariance());
  covariance_.block<6, 6>(kGyro, kGyro) += motion.bias_walk_covariance();
  covariance_(kScale, kScale) += scale_walk * scale_walk * dt;
  // The map turns relative to the camera. Velocity and gravity are fixed to the world, so their
  // coordinates in the map turn.
  Eigen::Matrix<double, 8, 3> turn;
  turn << R.transpose(), -skew(state_.velocity), Eigen::Matrix<double, 2, 3>::Identity();
  const Eigen::Matrix<double, 8, 8> walk =
      rotation_walk * rotation_walk * dt * turn * turn.transpose();
  covariance_.topLeftCorner<6, 6>() += walk.topLeftCorner<6, 6>();
  covariance_.block<6, 2>(0, kTilt) += walk.topRightCorner<6, 2>();
  covariance_.block<2, 6>(kTilt, 0) += walk.bottomLeftCorner<2, 6>();
  covariance_.block<2, 2>(kTilt, kTilt) += walk.bottomRightCorner<2, 2>();
  make_symmetric(covariance_);

  const Eigen::Vector3d position = state_.T_wb.translation() + dt * state_.velocity + further;
  state_.T_wb = Pose((state_.T_wb.rotation() * motion.motion().dR).normalized(), position);
  state_.velocity += faster;
}

InertialFilter::ByPose InertialFilter::by_errors() const {
  // T_bw becomes exp(-rotation, -R^T position) T_bw.
  Matrix6d by_body = Matrix6d::Zero();
  by_body.topLeftCorner<3, 3>() = -Eigen::Matrix3d::Identity();
  by_body.bottomRightCorner<3, 3>() = -state_.T_wb.rotation_matrix().transpose();
  const Matrix6d by_camera = adjoint(T_cb_) * by_body;
  ByPose J = ByPose::Zero();
  J.middleCols<3>(kRotation) = by_camera.leftCols<3>();
  J.middleCols<3>(kPosition) = by_camera.rightCols<3>();
  return J;
}

PoseGaussian InertialFilter::pose() const {
  const ByPose J = by_errors();
  PoseGaussian gaussian{T_cb_ * state_.T_wb.inverse(), transported(J, covariance_)};
  make_symmetric(gaussian.covariance);
  return gaussian;
}

void InertialFilter::add(const Error& error) {
  const Eigen::Vector3d turn = error.segment<3>(kRotation);
  state_.T_wb = Pose((state_.T_wb.rotation() * so3_exp(turn)).normalized(),
                     state_.T_wb.translation() + error.segment<3>(kPosition));
  state_.velocity += error.segment<3>(kVelocity);
  bias_.gyro += error.segment<3>(kGyro);
  bias_.accel += error.segment<3>(kAccel);
  tilt_ += error.segment<2>(kTilt);
  log_scale_ += error(kScale);
}

void InertialFilter::condition(const Vector6d& error, const Matrix6d& covariance) {
  const ByPose J = by_errors();
  const Matrix6d before = transported(J, covariance_);
  const Eigen::LDLT<Matrix6d> factor(before);
  const Eigen::Matrix<double, kSize, 6> cross = covariance_ * J.transpose();
  const Eigen::Matrix<double, kSize, 6> gain = factor.solve(cross.transpose()).transpose();
  add(gain * error);
  covariance_ += transported(gain, Matrix6d(covariance - before));
  make_symmetric(covariance_);
}

void InertialFilter::fuse(const Pose& T_cw, const Matrix6d& covariance, double inflation) {
  const PoseGaussian prior = pose();
  const Matrix6d I = Matrix6d::Identity();
  const Matrix6d information = prior.covariance.ldlt().solve(I);
  const Matrix6d of_image = covariance.ldlt().solve(I) - information;
  Matrix6d inflated = information + of_image / inflation;
  make_symmetric(inflated);
  const Vector6d error = (T_cw * prior.T_cw.inverse()).log();
  condition(error, inflated.ldlt().solve(I));
}

void InertialFilter::update(const Pose& T_cw, const Matrix6d& covariance) {
  const ByPose J = by_errors();
  const PoseGaussian prior = pose();
  const Matrix6d S = prior.covariance + covariance;
  const Eigen::Matrix<double, kSize, 6> cross = covariance_ * J.transpose();
  const Eigen::Matrix<double, kSize, 6> gain = S.ldlt().solve(cross.transpose()).transpose();
  const Vector6d error = (T_cw * prior.T_cw.inverse()).log();
  add(gain * error);
  // Joseph's form stays positive.
  const Covariance kept = Covariance::Identity() - gain * J;
  covariance_ = transported(kept, covariance_) + transported(gain, covariance);
  make_symmetric(covariance_);
}

double InertialFilter::distance(const Pose& T_cw, const Matrix6d& covariance) const {
  const PoseGaussian prior = pose();
  const Vector6d error = (T_cw * prior.T_cw.inverse()).log();
  const Matrix6d S = prior.covariance + covariance;
  return error.dot(S.ldlt().solve(error));
}

void InertialFilter::move(const Pose& T_cw) {
  const Pose T_wb = T_cw.inverse() * T_cb_;
  // Turns the quantities that are fixed to the map; those of the body do not change.
  const Eigen::Quaterniond turn =
      (T_wb.rotation() * state_.T_wb.rotation().conjugate()).normalized();
  const Eigen::Matrix3d R = turn.toRotationMatrix();
  Covariance A = Covariance::Identity();
  A.block<3, 3>(kVelocity, kVelocity) = R;
  A.block<3, 3>(kPosition, kPosition) = R;
  covariance_ = transported(A, covariance_);
  state_.T_wb = T_wb;
  state_.velocity = R * state_.velocity;
}

void InertialFilter::anchor() {
  // The axes of the map turn by less the error of the rotation, seen in the world.
  const Eigen::Matrix3d R = state_.T_wb.rotation_matrix();
  Covariance A = Covariance::Identity();
  A.block<3, 3>(kRotation, kRotation).setZero();
  A.block<3, 3>(kPosition, kPosition).setZero();
  A.block<3, 3>(kVelocity, kRotation) = skew(state_.velocity) * R;
  A.block<2, 3>(kTilt, kRotation) = -R.topRows<2>();
  covariance_ = transported(A, covariance_);
}

void InertialFilter::transform(const Eigen::Quaterniond& rotation, double factor,
                               const Eigen::Vector3d& shift) {
  const Eigen::Matrix3d R = rotation.toRotationMatrix();
  Covariance A = Covariance::Identity();
  A.block<3, 3>(kVelocity, kVelocity) = factor * R;
  A.block<3, 3>(kPosition, kPosition) = factor * R;
  covariance_ = transported(A, covariance_);
  // The camera stays where it is in the map.
  const Pose T_wc = state_.T_wb * T_bc_;
  const Pose moved((rotation * T_wc.rotation()).normalized(),
                   factor * (R * T_wc.translation()) + shift);
  state_.T_wb = moved * T_cb_;
  state_.velocity = factor * (R * state_.velocity);
  tilt_.setZero();
  log_scale_ = 0;
}

}  // namespace orbslam
