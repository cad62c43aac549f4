// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include "inertial/preintegration.hpp"

namespace orbslam {

/// Gaussian of a camera's pose: `T_cw = exp(e) mean`, `e` (rotation, translation).
struct PoseGaussian {
  Pose T_cw;
  Matrix6d covariance = Matrix6d::Zero();
};

/// Error-state Kalman filter for the state of the IMU in a map. Between two images it predicts by
/// preintegration; the pose of each image is a measurement. See docs/method/inertial.md#filter.
///
/// Errors are ordered (rotation, velocity, position, gyro bias, accelerometer bias, tilt of
/// gravity, logarithm of the scale). That of the rotation acts on the right, velocity and position
/// are added in the world. The tilt turns gravity about the first two axes of the world, whose
/// third one is up. The scale is units of the map per metre; 1 by its mean.
class InertialFilter {
 public:
  static constexpr int kSize = 18;
  using Covariance = Eigen::Matrix<double, kSize, kSize>;
  enum At {
    kRotation = 0,
    kVelocity = 3,
    kPosition = 6,
    kGyro = 9,
    kAccel = 12,
    kTilt = 15,
    kScale = 17
  };

  /// `T_cb` maps coordinates of the IMU into those of the camera. The world's third axis is up.
  InertialFilter(const Pose& T_cb, const ImuNoise& noise, const ImuState& state,
                 const ImuBias& bias, const Covariance& covariance);

  /// From the first sample to the last. Random walks for the drift of a growing map: `scale_walk`
  /// of the logarithm of a single camera's scale [1/sqrt(s)], `rotation_walk` of the map's axes
  /// [rad/sqrt(s)]. Throws std::invalid_argument as Preintegration does.
  void predict(const std::vector<ImuSample>& samples, double scale_walk = 0,
               double rotation_walk = 0);

  /// The pose of the camera.
  PoseGaussian pose() const;

  /// Updates by the pose of an image that was estimated with pose() as prior, and by its
  /// covariance. The information of the image is divided by `inflation`, because neighbouring
  /// images share errors of map points.
  void fuse(const Pose& T_cw, const Matrix6d& covariance, double inflation = 1);
  /// Updates by the pose of an image that was estimated without a prior.
  void update(const Pose& T_cw, const Matrix6d& covariance);
  /// Squared Mahalanobis distance of a pose with this covariance from pose(): 6 degrees of freedom.
  double distance(const Pose& T_cw, const Matrix6d& covariance) const;

  /// Follows a motion of the map: the camera now has this pose, and velocity and errors turn with
  /// it.
  void move(const Pose& T_cw);
  /// The map continues from the present pose, which has no error there by definition. The
  /// covariance of its error passes to velocity and gravity, in the axes of the body.
  void anchor();
  /// The map was turned and scaled: `x' = factor * (rotation x) + shift`. The tilt and scale that
  /// it corrects are taken from the means: both are 0 afterwards, their deviations stay.
  void transform(const Eigen::Quaterniond& rotation, double factor, const Eigen::Vector3d& shift);

  const ImuState& state() const { return state_; }
  const ImuBias& bias() const { return bias_; }
  const Covariance& covariance() const { return covariance_; }
  /// Rotation vector [rad], third entry 0, that turns (0, 0, -9.81) to the estimated gravity.
  const Eigen::Vector2d& tilt() const { return tilt_; }
  double log_scale() const { return log_scale_; }
  /// Acceleration of free fall in the world, m/s^2.
  Eigen::Vector3d gravity() const;

 private:
  using ByPose = Eigen::Matrix<double, 6, kSize>;
  using Error = Eigen::Matrix<double, kSize, 1>;
  ByPose by_errors() const;
  void add(const Error& error);
  /// Replaces the marginal of the pose: its mean moves by `error`.
  void condition(const Vector6d& error, const Matrix6d& covariance);

  Pose T_cb_, T_bc_;
  ImuNoise noise_;
  ImuState state_;
  ImuBias bias_;
  Eigen::Vector2d tilt_ = Eigen::Vector2d::Zero();
  double log_scale_ = 0;
  Covariance covariance_;
};

/// Standard gravity [m/s^2].
inline constexpr double kGravity = 9.81;

}  // namespace orbslam
