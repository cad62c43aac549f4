// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "inertial/imu_residual.hpp"
#include "optimize/bundle_adjustment.hpp"

namespace orbslam {

/// The inertial part of a bundle: residuals of the IMU between cameras, of the random walk of its
/// biases and of their priors. Unknowns are those of the free cameras, in the left tangent of T_cw,
/// then nine for every free motion: velocity, gyro bias, accelerometer bias. See
/// docs/method/inertial.md#bundle-adjustment.
class InertialSystem {
 public:
  static constexpr int kMotion = 9;

  /// `free_cameras`: the cameras of the problem that are unknowns, in order. The problem must
  /// outlive this.
  InertialSystem(const BundleProblem& problem, const std::vector<std::uint32_t>& free_cameras);

  bool empty() const { return problem_.inertial.links.empty(); }
  Eigen::Index n_camera_unknowns() const { return n_camera_unknowns_; }
  Eigen::Index n_unknowns() const { return n_unknowns_; }

  /// Weighted sum of squared residuals of the present motions, or those that `move` proposed.
  /// `poses`: T_cw of the free cameras.
  double cost(const std::vector<Pose>& poses, bool moved) const;
  /// Adds the normal equations at the present motions to the lower triangle of `H` and to `b`.
  void linearise(const std::vector<Pose>& poses, Eigen::MatrixXd& H, Eigen::VectorXd& b) const;
  /// Proposes motions: the present ones and a step of the unknowns.
  void move(const Eigen::VectorXd& step);
  void accept() { motions_ = moved_; }
  /// Writes the present motions to a problem.
  void write(BundleProblem& problem) const { problem.inertial.motions = motions_; }

 private:
  using Motion = BundleProblem::Motion;
  ImuState state(const std::vector<Pose>& poses, const Motion& motion) const;
  Eigen::Index at_camera(const Motion& motion) const;

  const BundleProblem& problem_;
  Pose T_bc_;
  Matrix6d to_body_;                        ///< tangents of the camera to those of the IMU
  std::vector<int> camera_at_, motion_at_;  ///< first unknown; -1: none
  std::vector<int> free_index_;             ///< per camera of the problem; -1: fixed
  std::vector<Matrix9d> information_;       ///< per link
  std::vector<Motion> priors_, motions_, moved_;
  Eigen::Index n_camera_unknowns_ = 0, n_unknowns_ = 0;
};

}  // namespace orbslam
