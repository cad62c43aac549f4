// SPDX-License-Identifier: BSD-3-Clause
#include "inertial/inertial_start.hpp"

#include <gtest/gtest.h>

#include <random>

#include "support/analytic_motion.hpp"

namespace orbslam {
namespace {

using testing::AnalyticMotion;
using testing::normal;

// The map is turned, and a unit of it is 2.5 m.
const Eigen::Quaterniond kTurn = so3_exp({0.5, 1.9, -0.7});
constexpr double kScale = 2.5;

struct Data {
  std::vector<InertialView> views;
  std::vector<std::vector<ImuSample>> samples;
};

Data data(int n_views, double step, double scale, std::mt19937_64& random) {
  Data all;
  for (int i = 0; i < n_views; ++i) {
    const double t = step * i;
    const Pose T_wb(AnalyticMotion::rotation(t), AnalyticMotion::position(t));
    const Pose T_wc = T_wb * testing::kT_cb.inverse();
    const Eigen::Vector3d turn(1e-3 * normal(random), 1e-3 * normal(random), 1e-3 * normal(random));
    const Eigen::Vector3d off(normal(random), normal(random), normal(random));
    all.views.push_back({t, Pose(kTurn * T_wc.rotation() * so3_exp(turn),
                                 kTurn * T_wc.translation() / scale + 2e-3 * off)});
    if (i + 1 == n_views) break;
    all.samples.push_back(testing::measured(AnalyticMotion::samples(t, t + step, 40),
                                            testing::kNoise, testing::kBias, random));
  }
  return all;
}

InertialStart start_of(const Data& all, bool metric) {
  InertialStartOptions options;
  options.metric = metric;
  options.rotation_deviation = 1e-3;
  options.position_deviation = 2e-3;
  return estimate_inertial_start(all.views, all.samples, testing::kT_cb, testing::kNoise, options);
}

double angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

TEST(InertialStart, FindsScaleGravityAndBiases) {
  std::mt19937_64 random(1);
  int within = 0;
  constexpr int kRuns = 10;
  double cost = 0, freedom = 0;
  for (int run = 0; run < kRuns; ++run) {
    const InertialStart start = start_of(data(21, 0.2, kScale, random), false);
    ASSERT_TRUE(start.solved);
    EXPECT_LT(start.scale_deviation, 0.03);
    within += std::abs(std::log(start.scale / kScale)) < 2 * start.scale_deviation;
    EXPECT_LT(angle(start.gravity, kTurn * testing::kFall), 3 * start.gravity_deviation);
    EXPECT_LT(start.gravity_deviation, 0.02);
    EXPECT_NEAR(start.gravity_length, 9.81, 0.5);
    EXPECT_LT((start.bias.gyro - testing::kBias.gyro).norm(), 2e-3);
    EXPECT_LT((start.bias.accel - testing::kBias.accel).norm(), 0.3);
    EXPECT_LT((start.velocities[10] - kTurn * AnalyticMotion::velocity(2)).norm(), 0.1);
    cost += start.cost;
    freedom += start.freedom;
  }
  EXPECT_GE(within, 8);
  EXPECT_NEAR(cost / freedom, 1, 0.2);
}

TEST(InertialStart, KeepsWhatIsKnownOfAMap) {
  // One second, in which the scale and gravity are hardly determined, of an upright map in metres.
  std::mt19937_64 random(5);
  double tilts = 0, scales = 0;
  constexpr int kRuns = 20;
  for (int run = 0; run < kRuns; ++run) {
    Data all = data(8, 0.15, 1, random);
    const double lean = 0.01 * normal(random), growth = std::exp(0.01 * normal(random));
    const Eigen::Quaterniond up = so3_exp({lean, 0, 0}) * kTurn.conjugate();
    for (InertialView& view : all.views) {
      view.T_wc = Pose(up * view.T_wc.rotation(), growth * (up * view.T_wc.translation()));
    }
    InertialStartOptions options;
    options.rotation_deviation = 1e-3;
    options.position_deviation = 2e-3;
    options.known_gravity = options.known_scale = 0.01;
    const InertialStart start =
        estimate_inertial_start(all.views, all.samples, testing::kT_cb, testing::kNoise, options);
    ASSERT_TRUE(start.solved);
    EXPECT_LT(start.gravity_deviation, 0.0101);
    EXPECT_LT(start.scale_deviation, 0.0101);
    const double off = angle(start.gravity, so3_exp({lean, 0, 0}) * testing::kFall);
    tilts += off * off / (start.gravity_deviation * start.gravity_deviation);
    scales += std::pow(std::log(start.scale * growth) / start.scale_deviation, 2);
  }
  EXPECT_LT(tilts / kRuns, 2);  // of two degrees of freedom
  EXPECT_LT(scales / kRuns, 2);
}

TEST(InertialStart, KnowsTheScaleOfADepthSensor) {
  std::mt19937_64 random(2);
  const InertialStart start = start_of(data(21, 0.2, 1, random), true);
  ASSERT_TRUE(start.solved);
  EXPECT_EQ(start.scale, 1);
  EXPECT_EQ(start.scale_deviation, 0);
  EXPECT_LT(angle(start.gravity, kTurn * testing::kFall), 3 * start.gravity_deviation);
  EXPECT_LT((start.up * start.gravity - testing::kFall).norm(), 1e-9);
}

TEST(InertialStart, FindsGravityAndGyroBiasAtRest) {
  std::mt19937_64 random(3);
  Data all = data(11, 0.2, 1, random);
  const Pose T_wc = all.views.front().T_wc;
  const Eigen::Vector3d force =
      (T_wc * testing::kT_cb).rotation().conjugate() * (kTurn * -testing::kFall);
  for (InertialView& view : all.views) view.T_wc = T_wc;
  for (auto& between : all.samples) {
    for (ImuSample& sample : between) {
      sample.gyro = testing::kBias.gyro;
      sample.accel = force;
    }
  }
  const InertialStart start = start_of(all, true);
  ASSERT_TRUE(start.solved);
  EXPECT_LT((start.bias.gyro - testing::kBias.gyro).norm(), 1e-3);
  EXPECT_LT(angle(start.gravity, kTurn * testing::kFall), 1e-3);
  // Tilt and bias of the accelerometer cannot be told apart: the prior of the bias is what is
  // known.
  EXPECT_NEAR(start.gravity_deviation, 0.2 / 9.81, 2e-3);
  // With one camera the scale is not determined.
  const InertialStart of_one = start_of(all, false);
  EXPECT_TRUE(!of_one.solved || of_one.scale_deviation > 0.3);
}

TEST(InertialStart, AWrongRotationOfTheImuDoesNotFit) {
  std::mt19937_64 random(4);
  const Data all = data(21, 0.2, 1, random);
  InertialStartOptions options;
  options.metric = true;
  options.rotation_deviation = 1e-3;
  const Pose wrong = Pose(so3_exp({0.5, 0, 0}), {0, 0, 0}) * testing::kT_cb;
  const InertialStart start =
      estimate_inertial_start(all.views, all.samples, wrong, testing::kNoise, options);
  EXPECT_TRUE(!start.solved || start.cost > 10 * start.freedom);
}

TEST(InertialStart, NeedsFourViews) {
  std::mt19937_64 random(5);
  EXPECT_THROW(start_of(data(3, 0.2, 1, random), true), std::invalid_argument);
}

}  // namespace
}  // namespace orbslam
