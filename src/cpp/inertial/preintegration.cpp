// SPDX-License-Identifier: BSD-3-Clause
#include "inertial/preintegration.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <utility>

#include "inertial/so3.hpp"

namespace orbslam {
namespace {

/// Two moments closer than this are the same [s].
constexpr double kSameTime = 1e-9;
/// Share of the range from which on a reading is saturated.
constexpr double kSaturated = 0.999;

void check(const std::vector<ImuSample>& samples, const ImuNoise& noise) {
  if (samples.size() < 2) {
    throw std::invalid_argument("preintegration needs two samples or more, got " +
                                std::to_string(samples.size()));
  }
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const ImuSample& sample = samples[i];
    if (!std::isfinite(sample.t) || !sample.gyro.allFinite() || !sample.accel.allFinite()) {
      throw std::invalid_argument("sample " + std::to_string(i) +
                                  " is not finite; leave such samples out");
    }
    if (i > 0 && !(sample.t > samples[i - 1].t)) {
      throw std::invalid_argument("the time of sample " + std::to_string(i) +
                                  " does not grow; sort the samples and leave out doubled ones");
    }
  }
  for (const double value : {noise.gyro, noise.accel, noise.gyro_walk, noise.accel_walk}) {
    if (!(value >= 0) || !std::isfinite(value)) {
      throw std::invalid_argument("noise densities must be finite and not negative");
    }
  }
}

ImuSample interpolated(const ImuSample& a, const ImuSample& b, double t) {
  const double share = (t - a.t) / (b.t - a.t);
  return {t, a.gyro + share * (b.gyro - a.gyro), a.accel + share * (b.accel - a.accel)};
}

std::vector<ImuSample>::const_iterator first_from(const std::vector<ImuSample>& samples, double t) {
  return std::lower_bound(samples.begin(), samples.end(), t,
                          [](const ImuSample& s, double time) { return s.t < time; });
}

/// The reading at a time: interpolated, or the nearest one beyond the ends.
ImuSample reading_at(const std::vector<ImuSample>& samples, double t) {
  const auto after = first_from(samples, t);
  if (after == samples.end()) return {t, samples.back().gyro, samples.back().accel};
  if (after == samples.begin()) return {t, after->gyro, after->accel};
  return interpolated(*(after - 1), *after, t);
}

bool same(const ImuBias& a, const ImuBias& b) { return a.gyro == b.gyro && a.accel == b.accel; }

}  // namespace

Preintegration::Preintegration(std::vector<ImuSample> samples, const ImuNoise& noise,
                               const ImuBias& bias, const PreintegrationOptions& options)
    : samples_(std::move(samples)), noise_(noise), bias_(bias), options_(options) {
  check(samples_, noise_);
  if (!bias_.gyro.allFinite() || !bias_.accel.allFinite()) {
    throw std::invalid_argument("the bias must be finite");
  }
  integrate();
}

void Preintegration::integrate() {
  count_saturated(samples_.front());
  for (std::size_t i = 1; i < samples_.size(); ++i) {
    add_interval(samples_[i - 1], samples_[i]);
    count_saturated(samples_[i]);
  }
  duration_ = end() - begin();
}

void Preintegration::add_interval(const ImuSample& from, const ImuSample& to) {
  const double dt = to.t - from.t;
  const Eigen::Vector3d w = 0.5 * (from.gyro + to.gyro) - bias_.gyro;
  const Eigen::Vector3d a = 0.5 * (from.accel + to.accel) - bias_.accel;
  const Eigen::Quaterniond half = so3_exp(0.5 * dt * w);
  const Eigen::Matrix3d M = (motion_.dR * half).toRotationMatrix();

  // Errors of a step: M exp(mu) with mu = half^T phi + Jr(w dt/2) dt/2 dw.
  const Eigen::Matrix3d half_t = half.conjugate().toRotationMatrix();
  const Eigen::Matrix3d turn = -dt * M * skew(a);  // of the step of the velocity, by mu
  const Eigen::Matrix3d v_by_phi = turn * half_t;
  const Eigen::Matrix3d v_by_w = turn * so3_right_jacobian(0.5 * dt * w) * (0.5 * dt);
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  Matrix9d A = Matrix9d::Identity();
  A.block<3, 3>(0, 0) = half_t * half_t;
  A.block<3, 3>(3, 0) = v_by_phi;
  A.block<3, 3>(6, 0) = 0.5 * dt * v_by_phi;
  A.block<3, 3>(6, 3) = dt * I;
  Matrix96d B = Matrix96d::Zero();  // by the rates (gyro, accelerometer)
  B.block<3, 3>(0, 0) = dt * so3_right_jacobian(dt * w);
  B.block<3, 3>(3, 0) = v_by_w;
  B.block<3, 3>(6, 0) = 0.5 * dt * v_by_w;
  B.block<3, 3>(3, 3) = dt * M;
  B.block<3, 3>(6, 3) = 0.5 * dt * dt * M;

  // White noise of a density s has the variance s^2 / dt in the mean over dt. In a gap nothing is
  // averaged, and the rates may have been anything between the two readings: uniform distribution.
  const bool is_gap = dt > options_.max_gap;
  const double averaged = is_gap ? options_.max_gap : dt;
  Vector6d variance;
  variance << Eigen::Vector3d::Constant(noise_.gyro * noise_.gyro / averaged),
      Eigen::Vector3d::Constant(noise_.accel * noise_.accel / averaged);
  if (is_gap) {
    variance.head<3>() += (to.gyro - from.gyro).cwiseAbs2() / 12.0;
    variance.tail<3>() += (to.accel - from.accel).cwiseAbs2() / 12.0;
    ++flags_.n_gaps;
    flags_.longest_gap = std::max(flags_.longest_gap, dt);
  }
  const Matrix9d moved = A * covariance_ * A.transpose();
  const Matrix9d added = B * variance.asDiagonal() * B.transpose();
  covariance_ = moved + added;
  const Matrix96d by_bias = A * by_bias_;
  by_bias_ = by_bias - B;

  const Eigen::Vector3d step = dt * (M * a);
  motion_.dp += dt * motion_.dv + 0.5 * dt * step;
  motion_.dv += step;
  motion_.dR = (motion_.dR * half * half).normalized();
}

void Preintegration::count_saturated(const ImuSample& sample) {
  flags_.n_saturated_gyro += sample.gyro.cwiseAbs().maxCoeff() >= kSaturated * options_.gyro_range;
  flags_.n_saturated_accel +=
      sample.accel.cwiseAbs().maxCoeff() >= kSaturated * options_.accel_range;
}

Matrix6d Preintegration::bias_walk_covariance() const {
  Vector6d variance;
  variance << Eigen::Vector3d::Constant(noise_.gyro_walk * noise_.gyro_walk * duration_),
      Eigen::Vector3d::Constant(noise_.accel_walk * noise_.accel_walk * duration_);
  return variance.asDiagonal();
}

ImuMotion Preintegration::corrected(const ImuBias& bias) const {
  Vector6d change;
  change << bias.gyro - bias_.gyro, bias.accel - bias_.accel;
  const Eigen::Matrix<double, 9, 1> moved = by_bias_ * change;
  ImuMotion motion = motion_;
  motion.dR = (motion_.dR * so3_exp(moved.head<3>())).normalized();
  motion.dv += moved.segment<3>(3);
  motion.dp += moved.tail<3>();
  return motion;
}

Preintegration Preintegration::reintegrated(const ImuBias& bias) const {
  return {samples_, noise_, bias, options_};
}

Preintegration Preintegration::joined(const Preintegration& next) const {
  if (std::abs(next.begin() - end()) > kSameTime) {
    throw std::invalid_argument("the second interval begins at " + std::to_string(next.begin()) +
                                " s, the first ends at " + std::to_string(end()) +
                                " s; only neighbours in time can be joined");
  }
  if (!same(next.bias_, bias_)) return joined(next.reintegrated(bias_));
  Preintegration both = *this;
  const Eigen::Matrix3d R = motion_.dR.toRotationMatrix();
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  const double dt = next.duration_;
  Matrix9d A = Matrix9d::Identity();  // by the errors of the first
  A.block<3, 3>(0, 0) = next.motion_.dR.conjugate().toRotationMatrix();
  A.block<3, 3>(3, 0) = -R * skew(next.motion_.dv);
  A.block<3, 3>(6, 0) = -R * skew(next.motion_.dp);
  A.block<3, 3>(6, 3) = dt * I;
  Matrix9d B = Matrix9d::Identity();  // by the errors of the second
  B.block<3, 3>(3, 3) = R;
  B.block<3, 3>(6, 6) = R;
  both.covariance_ = A * covariance_ * A.transpose();
  const Matrix9d second = B * next.covariance_ * B.transpose();
  both.covariance_ += second;
  both.by_bias_ = A * by_bias_;
  const Matrix96d second_by_bias = B * next.by_bias_;
  both.by_bias_ += second_by_bias;

  both.motion_.dp += dt * motion_.dv + R * next.motion_.dp;
  both.motion_.dv += R * next.motion_.dv;
  both.motion_.dR = (motion_.dR * next.motion_.dR).normalized();
  both.duration_ += dt;
  both.flags_.n_gaps += next.flags_.n_gaps;
  both.flags_.longest_gap = std::max(flags_.longest_gap, next.flags_.longest_gap);
  for (std::size_t i = 1; i < next.samples_.size(); ++i) {  // both have the sample in the middle
    both.samples_.push_back(next.samples_[i]);
    both.count_saturated(next.samples_[i]);
  }
  return both;
}

ImuState Preintegration::predict(const ImuState& state, const ImuBias& bias,
                                 const Eigen::Vector3d& gravity) const {
  const ImuMotion motion = corrected(bias);
  const Eigen::Quaterniond& R = state.T_wb.rotation();
  const double dt = duration_;
  const Eigen::Vector3d position =
      state.T_wb.translation() + dt * state.velocity + 0.5 * dt * dt * gravity + R * motion.dp;
  return {Pose(R * motion.dR, position), state.velocity + dt * gravity + R * motion.dv};
}

std::vector<ImuSample> samples_between(const std::vector<ImuSample>& samples, double begin,
                                       double end) {
  if (!(end > begin)) {
    throw std::invalid_argument("the interval from " + std::to_string(begin) + " s to " +
                                std::to_string(end) + " s is empty");
  }
  if (samples.empty() || samples.back().t < begin || samples.front().t > end) {
    throw std::invalid_argument("no sample lies between " + std::to_string(begin) + " s and " +
                                std::to_string(end) + " s");
  }
  std::vector<ImuSample> inside{reading_at(samples, begin)};
  const auto last = first_from(samples, end - kSameTime);
  for (auto at = first_from(samples, begin + kSameTime); at < last; ++at) inside.push_back(*at);
  inside.push_back(reading_at(samples, end));
  return inside;
}

}  // namespace orbslam
