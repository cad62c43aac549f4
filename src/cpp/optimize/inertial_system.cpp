// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/inertial_system.hpp"

#include <Eigen/Dense>

#include "inertial/so3.hpp"

namespace orbslam {
namespace {

using Index = Eigen::Index;

Vector6d difference(const ImuBias& a, const ImuBias& b) {
  Vector6d d;
  d << a.gyro - b.gyro, a.accel - b.accel;
  return d;
}

/// A block of a residual's derivative: where its unknowns begin, and their number.
template <int kRows>
struct Part {
  int at;  // -1: fixed
  Eigen::Matrix<double, kRows, Eigen::Dynamic> J;
};

template <int kRows, class Parts>
void add(const Parts& parts, const Eigen::Matrix<double, kRows, kRows>& information,
         const Eigen::Matrix<double, kRows, 1>& error, Eigen::MatrixXd& H, Eigen::VectorXd& b) {
  for (const auto& row : parts) {
    if (row.at < 0) continue;
    const Eigen::Matrix<double, Eigen::Dynamic, kRows> WJ = row.J.transpose() * information;
    b.segment(row.at, row.J.cols()) -= WJ * error;
    for (const auto& column : parts) {
      if (column.at < 0 || column.at > row.at) continue;
      H.block(row.at, column.at, row.J.cols(), column.J.cols()) += WJ * column.J;
    }
  }
}

}  // namespace

InertialSystem::InertialSystem(const BundleProblem& problem,
                               const std::vector<std::uint32_t>& free_cameras)
    : problem_(problem),
      T_bc_(problem.inertial.T_cb.inverse()),
      to_body_(adjoint(T_bc_)),
      priors_(problem.inertial.motions),
      motions_(problem.inertial.motions),
      moved_(problem.inertial.motions) {
  free_index_.assign(problem.cameras.size(), -1);
  for (std::size_t i = 0; i < free_cameras.size(); ++i) {
    free_index_[free_cameras[i]] = static_cast<int>(i);
  }
  n_camera_unknowns_ = 6 * static_cast<Index>(free_cameras.size());
  n_unknowns_ = n_camera_unknowns_;
  for (const Motion& motion : motions_) {
    const int free = free_index_[motion.camera];
    camera_at_.push_back(free < 0 ? -1 : 6 * free);
    motion_at_.push_back(motion.fixed ? -1 : static_cast<int>(n_unknowns_));
    if (!motion.fixed) n_unknowns_ += kMotion;
  }
  for (const auto& link : problem.inertial.links) {
    information_.push_back(link.motion->covariance().ldlt().solve(Matrix9d::Identity()));
  }
}

ImuState InertialSystem::state(const std::vector<Pose>& poses, const Motion& motion) const {
  const int free = free_index_[motion.camera];
  const Pose& T_cw =
      free < 0 ? problem_.cameras[motion.camera].T_cw : poses[static_cast<std::size_t>(free)];
  return {T_cw.inverse() * problem_.inertial.T_cb, motion.velocity};
}

double InertialSystem::cost(const std::vector<Pose>& poses, bool moved) const {
  const std::vector<Motion>& motions = moved ? moved_ : motions_;
  double sum = 0;
  for (std::size_t i = 0; i < problem_.inertial.links.size(); ++i) {
    const auto& link = problem_.inertial.links[i];
    const Motion &first = motions[link.first], &second = motions[link.second];
    const ImuResidual r = imu_residual(*link.motion, state(poses, first), first.bias,
                                       state(poses, second), problem_.inertial.gravity);
    sum += r.error.dot(information_[i] * r.error);
    const Vector6d walk = difference(second.bias, first.bias);
    sum +=
        walk.dot(link.motion->bias_walk_covariance().diagonal().cwiseInverse().asDiagonal() * walk);
  }
  for (std::size_t i = 0; i < motions.size(); ++i) {
    const Vector6d off = difference(motions[i].bias, priors_[i].bias);
    sum += off.dot(motions[i].bias_information.asDiagonal() * off);
  }
  return sum;
}

void InertialSystem::linearise(const std::vector<Pose>& poses, Eigen::MatrixXd& H,
                               Eigen::VectorXd& b) const {
  for (std::size_t i = 0; i < problem_.inertial.links.size(); ++i) {
    const auto& link = problem_.inertial.links[i];
    const Motion &first = motions_[link.first], &second = motions_[link.second];
    const ImuState from = state(poses, first), to = state(poses, second);
    const ImuResidual r =
        imu_residual(*link.motion, from, first.bias, to, problem_.inertial.gravity);
    const auto by_pose = [&](const Matrix9d& J, const ImuState& s) {
      // A step of the camera turns the IMU by minus its rotation, and moves it by minus R times its
      // translation.
      return (-J.leftCols<3>() * to_body_.topRows<3>() -
              J.rightCols<3>() * (s.T_wb.rotation_matrix() * to_body_.bottomRows<3>()))
          .eval();
    };
    Eigen::Matrix<double, 9, kMotion> by_first = Eigen::Matrix<double, 9, kMotion>::Zero();
    by_first << r.by_first.middleCols<3>(3), r.by_bias;
    const std::vector<Part<9>> parts{{camera_at_[link.first], by_pose(r.by_first, from)},
                                     {camera_at_[link.second], by_pose(r.by_second, to)},
                                     {motion_at_[link.first], by_first},
                                     {motion_at_[link.second], r.by_second.middleCols<3>(3)}};
    add<9>(parts, information_[i], r.error, H, b);
    const Matrix6d walk =
        link.motion->bias_walk_covariance().diagonal().cwiseInverse().asDiagonal();
    const auto bias_at = [&](std::uint32_t motion) {
      return motion_at_[motion] < 0 ? -1 : motion_at_[motion] + 3;
    };
    const std::vector<Part<6>> walks{{bias_at(link.first), -Matrix6d::Identity()},
                                     {bias_at(link.second), Matrix6d::Identity()}};
    add<6>(walks, walk, difference(second.bias, first.bias), H, b);
  }
  for (std::size_t i = 0; i < motions_.size(); ++i) {
    if (motion_at_[i] < 0) continue;
    const Vector6d off = difference(motions_[i].bias, priors_[i].bias);
    for (int k = 0; k < 6; ++k) {
      const Index at = motion_at_[i] + 3 + k;
      H(at, at) += motions_[i].bias_information(k);
      b(at) -= motions_[i].bias_information(k) * off(k);
    }
  }
}

void InertialSystem::move(const Eigen::VectorXd& step) {
  moved_ = motions_;
  for (std::size_t i = 0; i < moved_.size(); ++i) {
    if (motion_at_[i] < 0) continue;
    moved_[i].velocity += step.segment<3>(motion_at_[i]);
    moved_[i].bias.gyro += step.segment<3>(motion_at_[i] + 3);
    moved_[i].bias.accel += step.segment<3>(motion_at_[i] + 6);
  }
}

}  // namespace orbslam
