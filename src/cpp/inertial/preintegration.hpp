// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <limits>
#include <vector>

#include "base/pose.hpp"

namespace orbslam {

using Matrix9d = Eigen::Matrix<double, 9, 9>;
using Matrix96d = Eigen::Matrix<double, 9, 6>;

/// One reading of an IMU, in the frame of the IMU.
struct ImuSample {
  double t;               ///< seconds
  Eigen::Vector3d gyro;   ///< angular rate [rad/s]
  Eigen::Vector3d accel;  ///< specific force [m/s^2]; at rest it points up
};

/// Noise densities and random walks of an IMU in continuous time.
struct ImuNoise {
  double gyro = 0;        ///< rad/s/sqrt(Hz)
  double accel = 0;       ///< m/s^2/sqrt(Hz)
  double gyro_walk = 0;   ///< rad/s^2/sqrt(Hz)
  double accel_walk = 0;  ///< m/s^3/sqrt(Hz)
};

struct ImuBias {
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();   ///< rad/s
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();  ///< m/s^2
};

struct PreintegrationOptions {
  /// Seconds between two samples; a longer interval is counted as a gap.
  double max_gap = 0.05;
  /// Range of the gyro [rad/s] and of the accelerometer [m/s^2]; readings at the range are
  /// counted as saturated.
  double gyro_range = std::numeric_limits<double>::infinity();
  double accel_range = std::numeric_limits<double>::infinity();
};

/// Relative motion between the first and the last moment, free of gravity and of the first
/// velocity: `R_j = R_i dR`, `v_j = v_i + g dt + R_i dv`, `p_j = p_i + v_i dt + g dt^2/2 + R_i dp`.
struct ImuMotion {
  Eigen::Quaterniond dR = Eigen::Quaterniond::Identity();
  Eigen::Vector3d dv = Eigen::Vector3d::Zero();  ///< m/s
  Eigen::Vector3d dp = Eigen::Vector3d::Zero();  ///< metres
};

/// Pose and velocity of the IMU (the body b) in the world.
struct ImuState {
  Pose T_wb;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  ///< of the body in the world [m/s]
};

/// Irregularities of the samples of a preintegration: gaps and saturation.
struct ImuFlags {
  int n_gaps = 0;             ///< intervals longer than PreintegrationOptions::max_gap
  double longest_gap = 0;     ///< seconds; 0 if there is no gap
  int n_saturated_gyro = 0;   ///< samples with a reading at the range of the gyro
  int n_saturated_accel = 0;  ///< samples with a reading at the range of the accelerometer
};

/// IMU samples of an interval, preintegrated on the manifold after C. Forster, L. Carlone,
/// F. Dellaert, D. Scaramuzza, "On-Manifold Preintegration for Real-Time Visual-Inertial
/// Odometry", IEEE T-RO 2017.
///
/// Between two samples the rates are their mean, and the specific force is turned by the rotation
/// at half the time (midpoint rule). Errors are ordered (rotation, velocity, position); that of
/// the rotation acts on the right: `dR exp(error)`. The samples are kept, so that large changes of
/// the bias can integrate again.
class Preintegration {
 public:
  /// Integrates from the first sample to the last. Throws std::invalid_argument unless there are
  /// two samples or more, all finite, with growing times, and the noise is finite, not negative.
  Preintegration(std::vector<ImuSample> samples, const ImuNoise& noise, const ImuBias& bias,
                 const PreintegrationOptions& options = {});

  double begin() const { return samples_.front().t; }
  double end() const { return samples_.back().t; }
  double duration() const { return duration_; }

  /// At the bias it was integrated with.
  const ImuMotion& motion() const { return motion_; }
  /// Of (rotation, velocity, position), by the noise of gyro and accelerometer.
  const Matrix9d& covariance() const { return covariance_; }
  /// Derivative of (rotation, velocity, position) by the bias (gyro, accelerometer).
  const Matrix96d& by_bias() const { return by_bias_; }
  /// Of the change of the bias (gyro, accelerometer) during the interval: a diagonal matrix.
  Matrix6d bias_walk_covariance() const;

  const ImuBias& bias() const { return bias_; }
  const ImuNoise& noise() const { return noise_; }
  const ImuFlags& flags() const { return flags_; }
  const std::vector<ImuSample>& samples() const { return samples_; }

  /// The motion at another bias, to first order in the change of the bias.
  ImuMotion corrected(const ImuBias& bias) const;
  /// The same samples, integrated again with another bias.
  Preintegration reintegrated(const ImuBias& bias) const;
  /// Both intervals as one, with the bias, noise and options of this one; if the bias of `next`
  /// differs, `next` is integrated again. Throws std::invalid_argument unless `next` begins where
  /// this one ends.
  Preintegration joined(const Preintegration& next) const;

  /// Pose and velocity at the end of the interval from those at its begin.
  /// `gravity` is the acceleration of free fall in the world [m/s^2].
  ImuState predict(const ImuState& state, const ImuBias& bias,
                   const Eigen::Vector3d& gravity) const;

 private:
  void integrate();
  void add_interval(const ImuSample& from, const ImuSample& to);
  void count_saturated(const ImuSample& sample);

  std::vector<ImuSample> samples_;
  ImuNoise noise_;
  ImuBias bias_;
  PreintegrationOptions options_;
  double duration_ = 0;
  ImuMotion motion_;
  Matrix9d covariance_ = Matrix9d::Zero();
  Matrix96d by_bias_ = Matrix96d::Zero();
  ImuFlags flags_;
};

/// The samples of an interval of time: those inside, and at its ends linear interpolations between
/// the neighbours. Where no sample lies beyond an end, the nearest reading is held. Throws
/// std::invalid_argument if the interval is empty, or if no sample lies in it or next to it.
std::vector<ImuSample> samples_between(const std::vector<ImuSample>& samples, double begin,
                                       double end);

}  // namespace orbslam
