// SPDX-License-Identifier: BSD-3-Clause
#include "inertial/inertial_filter.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "support/analytic_motion.hpp"

namespace orbslam {
namespace {

using testing::AnalyticMotion;
using testing::normal;
using F = InertialFilter;

Pose camera_at(double t) {
  return testing::kT_cb * Pose(AnalyticMotion::rotation(t), AnalyticMotion::position(t)).inverse();
}

F::Covariance first_covariance() {
  Eigen::Matrix<double, F::kSize, 1> deviation;
  deviation << 0.01, 0.01, 0.01, 0.1, 0.1, 0.1, 0.01, 0.01, 0.01, 0.03, 0.03, 0.03, 0.15, 0.15,
      0.15, 0.01, 0.01, 1e-6;
  return deviation.cwiseAbs2().asDiagonal();
}

/// Error of a filter in its own order.
Eigen::Matrix<double, F::kSize, 1> error_of(const F& filter, double t) {
  Eigen::Matrix<double, F::kSize, 1> error;
  const ImuState& state = filter.state();
  error << so3_log((state.T_wb.rotation().conjugate() * AnalyticMotion::rotation(t)).normalized()),
      AnalyticMotion::velocity(t) - state.velocity,
      AnalyticMotion::position(t) - state.T_wb.translation(),
      testing::kBias.gyro - filter.bias().gyro, testing::kBias.accel - filter.bias().accel,
      -filter.tilt(), -filter.log_scale();
  return error;
}

/// A filter that begins with errors drawn from its covariance.
F drawn_filter(std::mt19937_64& random, double t) {
  const F::Covariance P = first_covariance();
  Eigen::Matrix<double, F::kSize, 1> e;
  for (int i = 0; i < F::kSize; ++i) e(i) = std::sqrt(P(i, i)) * normal(random);
  const Eigen::Vector3d turn = e.segment<3>(F::kRotation);
  const ImuState state{Pose((AnalyticMotion::rotation(t) * so3_exp(turn)).normalized(),
                            AnalyticMotion::position(t) + e.segment<3>(F::kPosition)),
                       AnalyticMotion::velocity(t) + e.segment<3>(F::kVelocity)};
  const ImuBias bias{testing::kBias.gyro + e.segment<3>(F::kGyro),
                     testing::kBias.accel + e.segment<3>(F::kAccel)};
  F::Covariance known = P;
  known.block<2, 2>(F::kTilt, F::kTilt) *= 1;
  return {testing::kT_cb, testing::kNoise, state, bias, known};
}

Vector6d drawn(std::mt19937_64& random, const Vector6d& deviation) {
  Vector6d e;
  for (int i = 0; i < 6; ++i) e(i) = deviation(i) * normal(random);
  return e;
}

Vector6d image_deviation() {
  Vector6d deviation;
  deviation << 1e-3, 1e-3, 1e-3, 5e-3, 5e-3, 5e-3;
  return deviation;
}

TEST(InertialFilter, ErrorsAreAsLargeAsTheCovarianceSays) {
  std::mt19937_64 random(1);
  const Matrix6d R = image_deviation().cwiseAbs2().asDiagonal();
  double first = 0, last = 0;
  constexpr int kRuns = 30;
  for (int run = 0; run < kRuns; ++run) {
    F filter = drawn_filter(random, 0);
    for (int image = 0; image < 100; ++image) {
      const double t = 0.05 * image;
      filter.predict(testing::measured(AnalyticMotion::samples(t, t + 0.05, 20), testing::kNoise,
                                       testing::kBias, random));
      const auto e = error_of(filter, t + 0.05).head<15>().eval();
      const Eigen::Matrix<double, 15, 15> P = filter.covariance().topLeftCorner<15, 15>();
      if (image == 0) first += e.dot(P.ldlt().solve(e));
      if (image == 99) last += e.dot(P.ldlt().solve(e));
      filter.update(Pose::exp(drawn(random, image_deviation())) * camera_at(t + 0.05), R);
    }
  }
  EXPECT_NEAR(first / kRuns, 15, 4);
  EXPECT_NEAR(last / kRuns, 15, 4.5);
}

TEST(InertialFilter, FindsBiasesTiltAndScale) {
  // The map is turned and of another size than the filter believes.
  const Eigen::Quaterniond turn = so3_exp({0.02, -0.03, 0});
  const double factor = 1.05;
  std::mt19937_64 random(2);
  const Pose T_wb0(turn * AnalyticMotion::rotation(0),
                   factor * (turn * AnalyticMotion::position(0)));
  F::Covariance P = first_covariance();
  P(F::kTilt, F::kTilt) = P(F::kTilt + 1, F::kTilt + 1) = 0.05 * 0.05;
  P(F::kScale, F::kScale) = 0.1 * 0.1;
  F filter(testing::kT_cb, testing::kNoise, {T_wb0, AnalyticMotion::velocity(0)}, {}, P);
  const Matrix6d R = image_deviation().cwiseAbs2().asDiagonal();
  for (int image = 0; image < 400; ++image) {
    const double t = 0.05 * (image + 1);
    filter.predict(testing::measured(AnalyticMotion::samples(t - 0.05, t, 20), testing::kNoise,
                                     testing::kBias, random));
    // The camera is where it is; the map around it is turned and larger.
    const Pose T_wc = camera_at(t).inverse();
    const Pose seen(turn * T_wc.rotation(), factor * (turn * T_wc.translation()));
    filter.update(Pose::exp(drawn(random, image_deviation())) * seen.inverse(), R);
  }
  EXPECT_LT((filter.bias().gyro - testing::kBias.gyro).norm(), 2e-3);
  EXPECT_LT((filter.bias().accel - testing::kBias.accel).norm(), 0.05);
  EXPECT_NEAR(filter.log_scale(), std::log(factor), 0.01);
  const Eigen::Vector3d down = turn * Eigen::Vector3d(0, 0, -1);
  EXPECT_LT(filter.gravity().normalized().cross(down).norm(), 3e-3);
  // Turned up and shrunk, its map is upright and metric.
  const Eigen::Quaterniond up = so3_exp({filter.tilt().x(), filter.tilt().y(), 0}).conjugate();
  filter.transform(up, std::exp(-filter.log_scale()), {0, 0, 0});
  EXPECT_EQ(filter.tilt(), Eigen::Vector2d::Zero());
  EXPECT_NEAR(filter.state().velocity.norm(), AnalyticMotion::velocity(20).norm(), 0.03);
}

TEST(InertialFilter, LeadsThroughThreeSecondsWithoutImages) {
  std::mt19937_64 random(3);
  const Matrix6d R = image_deviation().cwiseAbs2().asDiagonal();
  double distance = 0, off = 0;
  constexpr int kRuns = 30;
  for (int run = 0; run < kRuns; ++run) {
    F filter = drawn_filter(random, 0);
    for (int image = 0; image < 260; ++image) {
      const double t = 0.05 * image;
      filter.predict(testing::measured(AnalyticMotion::samples(t, t + 0.05, 20), testing::kNoise,
                                       testing::kBias, random));
      if (image < 200) {
        filter.update(Pose::exp(drawn(random, image_deviation())) * camera_at(t + 0.05), R);
      }
    }
    off += (filter.pose().T_cw.center() - camera_at(13).center()).norm();
    distance += filter.distance(camera_at(13), Matrix6d::Zero());
  }
  EXPECT_LT(off / kRuns, 0.15);
  EXPECT_NEAR(distance / kRuns, 6, 2.5);
}

TEST(InertialFilter, GoesOnFromAnAnchoredPose) {
  // After three seconds without images the map continues at the predicted pose, in axes of its own.
  std::mt19937_64 random(6);
  const Matrix6d R = image_deviation().cwiseAbs2().asDiagonal();
  double distance = 0;
  constexpr int kRuns = 40;
  for (int run = 0; run < kRuns; ++run) {
    F filter = drawn_filter(random, 0);
    Pose moved;  // from the true world to the one of the new part
    double t = 0;
    for (int image = 0; image < 280; ++image, t = 0.05 * image) {
      filter.predict(testing::measured(AnalyticMotion::samples(t, t + 0.05, 20), testing::kNoise,
                                       testing::kBias, random));
      if (image == 260) {
        const Pose T_wb(AnalyticMotion::rotation(t + 0.05), AnalyticMotion::position(t + 0.05));
        moved = filter.state().T_wb * T_wb.inverse();
        filter.anchor();
        EXPECT_LT(filter.pose().covariance.norm(), 1e-12);
      } else if (image < 200 || image > 260) {
        const Pose T_cw = camera_at(t + 0.05) * moved.inverse();
        filter.update(Pose::exp(drawn(random, image_deviation())) * T_cw, R);
      }
    }
    Eigen::Matrix<double, 5, 1> e;
    e << moved.rotation() * AnalyticMotion::velocity(t) - filter.state().velocity,
        so3_log(moved.rotation()).head<2>() - filter.tilt();
    Eigen::Matrix<double, 5, 5> P;
    P << filter.covariance().block<3, 3>(F::kVelocity, F::kVelocity),
        filter.covariance().block<3, 2>(F::kVelocity, F::kTilt),
        filter.covariance().block<2, 3>(F::kTilt, F::kVelocity),
        filter.covariance().block<2, 2>(F::kTilt, F::kTilt);
    distance += e.dot(P.ldlt().solve(e));
  }
  EXPECT_NEAR(distance / kRuns, 5, 2);
}

TEST(InertialFilter, AFusedPoseIsThatOfAnUpdate) {
  std::mt19937_64 random(4);
  F one = drawn_filter(random, 0);
  one.predict(AnalyticMotion::samples(0, 0.05, 20));
  F other = one;
  const Matrix6d R = image_deviation().cwiseAbs2().asDiagonal();
  const Pose seen = Pose::exp(1e-3 * Vector6d::Ones()) * one.pose().T_cw;
  one.update(seen, R);
  const PoseGaussian fused = one.pose();
  other.fuse(fused.T_cw, fused.covariance);
  EXPECT_LT((one.state().velocity - other.state().velocity).norm(), 1e-6);
  EXPECT_LT((one.bias().accel - other.bias().accel).norm(), 1e-5);
  EXPECT_LT((one.covariance() - other.covariance()).cwiseAbs().maxCoeff(), 1e-6);
}

TEST(InertialFilter, AMovedMapTurnsTheVelocity) {
  std::mt19937_64 random(5);
  F filter = drawn_filter(random, 0);
  const Eigen::Vector3d before = filter.state().velocity;
  const Pose T_cw = filter.pose().T_cw;
  const Pose map_motion(so3_exp({0, 0, 0.5}), {1, 2, 3});
  filter.move(T_cw * map_motion.inverse());
  EXPECT_LT((filter.state().velocity - map_motion.rotation() * before).norm(), 1e-12);
  EXPECT_LT((filter.pose().T_cw.matrix() - (T_cw * map_motion.inverse()).matrix()).norm(), 1e-12);
}

}  // namespace
}  // namespace orbslam
