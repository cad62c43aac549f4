// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "inertial/preintegration.hpp"

namespace orbslam {

using Vector9d = Eigen::Matrix<double, 9, 1>;
using Matrix93d = Eigen::Matrix<double, 9, 3>;

/// Difference between two states and the preintegrated motion between them (Forster et al. 2017,
/// section VI), with its derivatives. Errors of a state are ordered (rotation, velocity, position);
/// that of the rotation acts on the right, the others are added in the world.
struct ImuResidual {
  Vector9d error;        ///< (rotation, velocity, position), in the frame of the first state
  Matrix9d by_first;     ///< by the error of the first state
  Matrix9d by_second;    ///< by that of the second
  Matrix96d by_bias;     ///< by the bias (gyro, accelerometer)
  Matrix93d by_gravity;  ///< by the acceleration of free fall
};

ImuResidual imu_residual(const Preintegration& motion, const ImuState& first, const ImuBias& bias,
                         const ImuState& second, const Eigen::Vector3d& gravity);

}  // namespace orbslam
