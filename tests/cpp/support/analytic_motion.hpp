// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "inertial/preintegration.hpp"
#include "inertial/so3.hpp"
#include "support/random_numbers.hpp"

namespace orbslam::testing {

// Of the samples: noise, biases, and the place of the camera.
inline constexpr ImuNoise kNoise{1e-3, 2e-2, 1e-5, 1e-4};
inline const ImuBias kBias{{0.02, -0.03, 0.01}, {0.1, -0.15, 0.05}};
inline const Pose kT_cb(so3_exp({0.3, -1.2, 0.4}), {0.05, -0.02, 0.1});

inline const Eigen::Vector3d kFall(0, 0, -9.81);

/// A smooth motion with known derivatives: R = exp(axis angle(t)) exp(other axis t), p of sines.
struct AnalyticMotion {
  static Eigen::Quaterniond rotation(double t) {
    return so3_exp({0, 0.5 * std::sin(1.3 * t), 0}) * so3_exp({0.7 * t, 0, 0});
  }
  static Eigen::Vector3d position(double t) {
    return {std::sin(t), 0.5 * std::cos(1.7 * t), 0.3 * t + 0.2 * std::sin(2.1 * t)};
  }
  static Eigen::Vector3d velocity(double t) {
    return {std::cos(t), -0.85 * std::sin(1.7 * t), 0.3 + 0.42 * std::cos(2.1 * t)};
  }
  static Eigen::Vector3d acceleration(double t) {
    return {-std::sin(t), -1.445 * std::cos(1.7 * t), -0.882 * std::sin(2.1 * t)};
  }
  static ImuSample sample(double t) {
    // The rate of A B in its own frame is B^T w_A + w_B.
    const Eigen::Vector3d w_A(0, 0.65 * std::cos(1.3 * t), 0);
    const Eigen::Vector3d gyro =
        so3_exp({0.7 * t, 0, 0}).conjugate() * w_A + Eigen::Vector3d(0.7, 0, 0);
    return {t, gyro, rotation(t).conjugate() * (acceleration(t) - kFall)};
  }
  static std::vector<ImuSample> samples(double begin, double end, int n_intervals) {
    std::vector<ImuSample> all;
    for (int i = 0; i <= n_intervals; ++i) {
      all.push_back(sample(begin + (end - begin) * i / n_intervals));
    }
    return all;
  }
};

inline double normal(std::mt19937_64& random) {
  const double radius = std::sqrt(-2 * std::log(1 - uniform(random)));
  return radius * std::cos(6.283185307179586 * uniform(random));
}

/// Samples with white noise and a constant bias.
inline std::vector<ImuSample> measured(std::vector<ImuSample> samples, const ImuNoise& noise,
                                       const ImuBias& bias, std::mt19937_64& random) {
  const double root =
      std::sqrt(static_cast<double>(samples.size() - 1) / (samples.back().t - samples.front().t));
  for (ImuSample& sample : samples) {
    for (int i = 0; i < 3; ++i) {
      sample.gyro(i) += bias.gyro(i) + noise.gyro * root * normal(random);
      sample.accel(i) += bias.accel(i) + noise.accel * root * normal(random);
    }
  }
  return samples;
}

}  // namespace orbslam::testing
