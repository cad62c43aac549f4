// SPDX-License-Identifier: BSD-3-Clause
#include "inertial/preintegration.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include "inertial/so3.hpp"
#include "support/analytic_motion.hpp"

namespace orbslam {
namespace {

using testing::AnalyticMotion;
using testing::kFall;
using testing::normal;
using testing::uniform;
using Vector9d = Eigen::Matrix<double, 9, 1>;

constexpr ImuNoise kImuNoise{1e-3, 2e-2, 1e-4, 1e-3};
Vector9d difference(const ImuMotion& a, const ImuMotion& b) {
  Vector9d d;
  d << so3_log(b.dR.conjugate() * a.dR), a.dv - b.dv, a.dp - b.dp;
  return d;
}

Preintegration of(const std::vector<ImuSample>& samples, const ImuBias& bias = {}) {
  return {samples, kImuNoise, bias};
}

TEST(Preintegration, FollowsAnAnalyticMotion) {
  const double begin = 0.4, end = 1.4;
  const ImuState first{{AnalyticMotion::rotation(begin), AnalyticMotion::position(begin)},
                       AnalyticMotion::velocity(begin)};
  double before = 0;
  for (const int n : {100, 200, 400}) {
    const ImuState last = of(AnalyticMotion::samples(begin, end, n)).predict(first, {}, kFall);
    const double turn =
        so3_log(last.T_wb.rotation().conjugate() * AnalyticMotion::rotation(end)).norm();
    const double moved = (last.T_wb.translation() - AnalyticMotion::position(end)).norm();
    const double error = turn + moved + (last.velocity - AnalyticMotion::velocity(end)).norm();
    EXPECT_LT(error, 3e-3 * (100.0 / n) * (100.0 / n)) << n;
    if (before > 0) {  // of second order: half the step, a quarter of the error
      EXPECT_NEAR(before / error, 4.0, 0.2);
    }
    before = error;
  }
}

TEST(Preintegration, KnowsConstantRates) {
  // A turn about z with a constant rate, measured without a force: exact.
  std::vector<ImuSample> turning, falling;
  for (int i = 0; i <= 200; ++i) {
    turning.push_back({0.005 * i, {0, 0, 1.5}, Eigen::Vector3d::Zero()});
    falling.push_back({0.005 * i, Eigen::Vector3d::Zero(), {1, -2, 9.81}});
  }
  const ImuMotion turn = of(turning).motion();
  EXPECT_LT((so3_log(turn.dR) - Eigen::Vector3d(0, 0, 1.5)).norm(), 1e-12);
  EXPECT_EQ(turn.dv, Eigen::Vector3d::Zero());
  const ImuState state = of(falling).predict({}, {}, kFall);
  EXPECT_LT((state.velocity - Eigen::Vector3d(1, -2, 0)).norm(), 1e-12);
  EXPECT_LT((state.T_wb.translation() - Eigen::Vector3d(0.5, -1, 0)).norm(), 1e-12);
}

TEST(Preintegration, BiasJacobiansAreCentralDifferences) {
  const auto samples = AnalyticMotion::samples(0.2, 0.9, 140);
  const ImuBias bias{{0.01, -0.02, 0.03}, {0.1, 0.2, -0.1}};
  const Preintegration at = of(samples, bias);
  for (int i = 0; i < 6; ++i) {
    ImuBias more = bias, less = bias;
    const double h = 1e-5;
    (i < 3 ? more.gyro(i) : more.accel(i - 3)) += h;
    (i < 3 ? less.gyro(i) : less.accel(i - 3)) -= h;
    const Vector9d derivative = (difference(of(samples, more).motion(), at.motion()) -
                                 difference(of(samples, less).motion(), at.motion())) /
                                (2 * h);
    EXPECT_LT((derivative - at.by_bias().col(i)).norm(), 1e-7) << i;
  }
}

TEST(Preintegration, CorrectsTheBiasToFirstOrder) {
  const auto samples = AnalyticMotion::samples(0, 0.5, 100);
  const Preintegration at = of(samples);
  for (const double size : {1e-2, 1e-3}) {
    const ImuBias bias{size * Eigen::Vector3d(1, -2, 1), 5 * size * Eigen::Vector3d(-1, 1, 2)};
    const Vector9d left = difference(at.corrected(bias), of(samples, bias).motion());
    EXPECT_LT(left.norm(), 10 * size * size);  // what is left is of second order
    EXPECT_EQ(difference(at.reintegrated(bias).motion(), of(samples, bias).motion()).norm(), 0);
  }
}

TEST(Preintegration, CovarianceIsThatOfManyDraws) {
  const auto exact = AnalyticMotion::samples(0, 0.5, 100);
  const Preintegration at = of(exact);
  std::mt19937_64 random(7);
  const double root = std::sqrt(200.0);  // samples per second
  const Matrix9d inverse = at.covariance().llt().solve(Matrix9d::Identity());
  constexpr int kDraws = 1500;
  double chi2 = 0;
  Matrix9d sum = Matrix9d::Zero();
  for (int draw = 0; draw < kDraws; ++draw) {
    std::vector<ImuSample> noisy = exact;
    for (ImuSample& sample : noisy) {
      for (int i = 0; i < 3; ++i) sample.gyro(i) += kImuNoise.gyro * root * normal(random);
      for (int i = 0; i < 3; ++i) sample.accel(i) += kImuNoise.accel * root * normal(random);
    }
    const Vector9d error = difference(of(noisy).motion(), at.motion());
    chi2 += error.dot(inverse * error);
    sum += error * error.transpose();
  }
  // The mean of 1500 draws of chi2 with 9 degrees of freedom: deviation sqrt(18 / 1500) = 0.11.
  EXPECT_NEAR(chi2 / kDraws, 9.0, 0.4);
  for (int i = 0; i < 9; ++i) {
    EXPECT_NEAR(sum(i, i) / kDraws / at.covariance()(i, i), 1.0, 0.15) << i;
  }
  // Rotation, by hand: density^2 times the time.
  EXPECT_NEAR(at.covariance()(0, 0), 1e-6 * 0.5, 1e-8);
}

TEST(Preintegration, BiasWalkGrowsWithTheTime) {
  const Matrix6d walk = of(AnalyticMotion::samples(0, 0.5, 100)).bias_walk_covariance();
  EXPECT_NEAR(walk(1, 1), 1e-8 * 0.5, 1e-15);
  EXPECT_NEAR(walk(4, 4), 1e-6 * 0.5, 1e-13);
  EXPECT_EQ(walk(0, 1), 0);
}

TEST(Preintegration, JoinedIsIntegratedInOneGo) {
  const auto samples = AnalyticMotion::samples(0, 1, 200);
  const auto middle = samples.begin() + 80;
  const ImuBias bias{{0.01, -0.02, 0.03}, {0.1, 0.2, -0.1}};
  const Preintegration whole = of(samples, bias);
  const Preintegration first = of({samples.begin(), middle + 1}, bias);
  for (const ImuBias& other : {bias, ImuBias{}}) {  // with another bias it is integrated again
    const Preintegration joined = first.joined(of({middle, samples.end()}, other));
    EXPECT_LT(difference(joined.motion(), whole.motion()).norm(), 1e-12);
    EXPECT_LT((joined.covariance() - whole.covariance()).norm(), 1e-12 * whole.covariance().norm());
    EXPECT_LT((joined.by_bias() - whole.by_bias()).norm(), 1e-12);
    EXPECT_EQ(joined.samples().size(), samples.size());
    EXPECT_NEAR(joined.duration(), 1, 1e-12);
  }
  EXPECT_THROW(first.joined(first), std::invalid_argument);
}

TEST(Preintegration, FlagsGapsAndSaturation) {
  auto samples = AnalyticMotion::samples(0, 0.5, 100);
  const Matrix9d without = of(samples).covariance();
  samples.erase(samples.begin() + 40, samples.begin() + 60);
  samples[10].gyro.y() = -35;
  samples[50].accel.z() = 156.9;
  const Preintegration at(samples, kImuNoise, {}, {0.05, 35, 156.9});
  EXPECT_EQ(at.flags().n_gaps, 1);
  EXPECT_NEAR(at.flags().longest_gap, 0.105, 1e-12);
  EXPECT_EQ(at.flags().n_saturated_gyro, 1);
  EXPECT_EQ(at.flags().n_saturated_accel, 1);
  EXPECT_GT(at.covariance().trace(), without.trace());
  const Preintegration first(std::vector<ImuSample>(samples.begin(), samples.begin() + 51),
                             kImuNoise, {}, {0.05, 35, 156.9});
  const Preintegration second(std::vector<ImuSample>(samples.begin() + 50, samples.end()),
                              kImuNoise, {}, {0.05, 35, 156.9});
  const ImuFlags joined = first.joined(second).flags();
  EXPECT_EQ(joined.n_gaps, 1);
  EXPECT_EQ(joined.n_saturated_accel, 1);  // of the sample that both have
}

TEST(Preintegration, RefusesSamplesThatCannotBeIntegrated) {
  const auto good = AnalyticMotion::samples(0, 0.1, 20);
  EXPECT_THROW(of({good.front()}), std::invalid_argument);
  auto doubled = good;
  doubled[3].t = doubled[2].t;
  EXPECT_THROW(of(doubled), std::invalid_argument);
  auto broken = good;
  broken[4].accel.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(of(broken), std::invalid_argument);
  EXPECT_THROW(Preintegration(good, {-1, 0, 0, 0}, {}), std::invalid_argument);
}

TEST(SamplesBetween, InterpolatesAtTheEnds) {
  std::vector<ImuSample> samples;
  for (int i = 0; i < 11; ++i) {
    samples.push_back({0.1 * i, {1.0 * i, 0, 0}, {0, 2.0 * i, 0}});
  }
  const auto inside = samples_between(samples, 0.25, 0.5);
  ASSERT_EQ(inside.size(), 4U);
  EXPECT_DOUBLE_EQ(inside.front().t, 0.25);
  EXPECT_NEAR(inside.front().gyro.x(), 2.5, 1e-12);
  EXPECT_DOUBLE_EQ(inside.back().t, 0.5);
  EXPECT_NEAR(inside.back().accel.y(), 10, 1e-12);
  const auto beyond = samples_between(samples, 0.95, 1.2);  // held
  EXPECT_NEAR(beyond.back().gyro.x(), 10, 1e-12);
  EXPECT_DOUBLE_EQ(beyond.back().t, 1.2);
  EXPECT_THROW(samples_between(samples, 2, 3), std::invalid_argument);
  EXPECT_THROW(samples_between(samples, 0.5, 0.5), std::invalid_argument);
}

}  // namespace
}  // namespace orbslam
