// SPDX-License-Identifier: BSD-3-Clause
#include "inertial/imu_residual.hpp"

#include <gtest/gtest.h>

#include "support/analytic_motion.hpp"

namespace orbslam {
namespace {

using testing::AnalyticMotion;
using testing::kFall;

ImuState moved(const ImuState& state, const Vector9d& error) {
  const Eigen::Vector3d turn = error.head<3>();
  return {Pose((state.T_wb.rotation() * so3_exp(turn)).normalized(),
               state.T_wb.translation() + error.tail<3>()),
          state.velocity + error.segment<3>(3)};
}

TEST(ImuResidual, IsZeroForThePredictedState) {
  const Preintegration motion(AnalyticMotion::samples(0.2, 0.7, 100), testing::kNoise, {});
  const ImuState first{{AnalyticMotion::rotation(0.2), AnalyticMotion::position(0.2)},
                       AnalyticMotion::velocity(0.2)};
  const ImuState second = motion.predict(first, {}, kFall);
  EXPECT_LT(imu_residual(motion, first, {}, second, kFall).error.norm(), 1e-12);
}

TEST(ImuResidual, DerivativesAreCentralDifferences) {
  const Preintegration motion(AnalyticMotion::samples(0.2, 0.7, 100), testing::kNoise, {});
  const ImuState first{{AnalyticMotion::rotation(0.2), {1, 2, 3}}, {0.5, 0.2, -0.3}};
  const ImuState second{{AnalyticMotion::rotation(0.75), {1.2, 2.1, 3}}, {0.6, 0.1, -0.3}};
  const ImuBias bias{{0.01, -0.02, 0.03}, {0.1, 0.2, -0.1}};
  const ImuResidual at = imu_residual(motion, first, bias, second, kFall);
  constexpr double h = 1e-6;
  const auto slope = [&](const auto& error_at) -> Vector9d {
    return (error_at(h) - error_at(-h)) / (2 * h);
  };
  for (int i = 0; i < 9; ++i) {
    const Vector9d axis = Vector9d::Unit(i);
    const Vector9d of_first = slope([&](double d) {
      return imu_residual(motion, moved(first, d * axis), bias, second, kFall).error;
    });
    const Vector9d of_second = slope([&](double d) {
      return imu_residual(motion, first, bias, moved(second, d * axis), kFall).error;
    });
    EXPECT_LT((at.by_first.col(i) - of_first).norm(), 1e-7) << i;
    EXPECT_LT((at.by_second.col(i) - of_second).norm(), 1e-7) << i;
  }
  for (int i = 0; i < 6; ++i) {
    const Vector9d of_bias = slope([&](double d) {
      ImuBias other = bias;
      (i < 3 ? other.gyro(i) : other.accel(i - 3)) += d;
      return imu_residual(motion, first, other, second, kFall).error;
    });
    EXPECT_LT((at.by_bias.col(i) - of_bias).norm(), 1e-7) << i;
  }
  for (int i = 0; i < 3; ++i) {
    const Vector9d of_gravity = slope([&](double d) {
      const Eigen::Vector3d other = kFall + d * Eigen::Vector3d::Unit(i);
      return imu_residual(motion, first, bias, second, other).error;
    });
    EXPECT_LT((at.by_gravity.col(i) - of_gravity).norm(), 1e-7) << i;
  }
}

}  // namespace
}  // namespace orbslam
