// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "inertial/inertial_filter.hpp"

namespace orbslam {

/// The pose of the camera in a map whose scale and gravity need not be known.
struct InertialView {
  double t = 0;  ///< seconds
  Pose T_wc;
};

struct InertialStartOptions {
  bool metric = false;  ///< the unit of the map is the metre
  /// Standard deviations of the views' poses: rad, and units of the map.
  double rotation_deviation = 2e-3, position_deviation = 5e-3;
  /// Mean and standard deviations of the biases before: rad/s, m/s^2.
  ImuBias bias;
  double gyro_deviation = 0.1, accel_deviation = 0.2;
  /// Of a map that an IMU has turned upright and scaled before: standard deviations of the third
  /// axis from the vertical [rad] and of the logarithm of the scale. 0: nothing is known.
  double known_gravity = 0, known_scale = 0;
};

struct InertialStart {
  /// False if the linear problem has no solution with a positive scale; the rest is meaningless.
  bool solved = false;
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  ///< m/s^2, in the map
  double gravity_length = 0;  ///< of the linear problem, which does not know it: a check [m/s^2]
  double scale = 1;           ///< metres per unit of the map
  ImuBias bias;
  std::vector<Eigen::Vector3d> velocities;  ///< of the IMU at the views, m/s, axes of the map
  double scale_deviation = 0;               ///< of the logarithm
  double gravity_deviation = 0;             ///< larger one of the two directions [rad]
  /// Weighted sum of squared residuals, and their number less that of the unknowns.
  double cost = 0;
  int freedom = 0;
  /// Of the last view, in the order of InertialFilter, once the map has been turned by `up` and
  /// multiplied by `scale`.
  InertialFilter::Covariance covariance = InertialFilter::Covariance::Zero();
  Eigen::Quaterniond up = Eigen::Quaterniond::Identity();  ///< turns gravity to (0, 0, -9.81)
};

/// Gravity, scale, biases and velocities from views and the samples between them: the inertial-only
/// estimate of C. Campos, J. M. M. Montiel, J. D. Tardos, "Inertial-Only Optimization for
/// Visual-Inertial Initialization", ICRA 2020. The views' poses are unknowns as well, with their
/// standard deviations as prior, so that the covariance of the result is that of the data.
/// `samples[i]` lead from view i to view i + 1. Throws std::invalid_argument unless there are four
/// views or more, with samples between all of them.
InertialStart estimate_inertial_start(const std::vector<InertialView>& views,
                                      const std::vector<std::vector<ImuSample>>& samples,
                                      const Pose& T_cb, const ImuNoise& noise,
                                      const InertialStartOptions& options);

}  // namespace orbslam
