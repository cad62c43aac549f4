// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/motion_hypotheses.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "geometry/triangulation.hpp"
#include "scenes.hpp"

namespace orbslam {
namespace {

Eigen::Matrix3d calibration() {
  Eigen::Matrix3d K;
  K << 520, 0, 320, 0, 525, 240, 0, 0, 1;
  return K;
}

Pose random_motion(std::mt19937_64& random) {
  Vector6d xi;
  for (int i = 0; i < 6; ++i) xi(i) = testing::uniform(random, -0.6, 0.6);
  return Pose::exp(xi);
}

/// Distance of the closest hypothesis: rotation and direction of translation together.
double closest(const std::vector<Motion>& motions, const Pose& T_21) {
  double least = 1e9;
  for (const Motion& motion : motions) {
    least = std::min(least, (motion.R - T_21.rotation_matrix()).norm() +
                                (motion.t - T_21.translation().normalized()).norm());
  }
  return least;
}

void expect_proper(const std::vector<Motion>& motions) {
  for (const Motion& motion : motions) {
    EXPECT_LT((motion.R * motion.R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-9);
    EXPECT_NEAR(motion.R.determinant(), 1, 1e-9);
    EXPECT_NEAR(motion.t.norm(), 1, 1e-12);
  }
}

TEST(MotionsFromHomography, ContainTheTrueMotionWhateverTheSignAndScale) {
  std::mt19937_64 random(1);
  const Eigen::Matrix3d K = calibration();
  for (int trial = 0; trial < 200; ++trial) {
    const Pose T_21 = random_motion(random);
    const Eigen::Vector3d normal(testing::uniform(random, -0.5, 0.5),
                                 testing::uniform(random, -0.5, 0.5), 1);
    const double distance = testing::uniform(random, 1, 5);
    const Eigen::Matrix3d H_21 =
        K *
        (T_21.rotation_matrix() + T_21.translation() * normal.normalized().transpose() / distance) *
        K.inverse();
    for (const double factor : {1.0, -0.3}) {
      const auto motions = motions_from_homography(factor * H_21, K);
      ASSERT_EQ(motions.size(), 8U);
      expect_proper(motions);
      EXPECT_LT(closest(motions, T_21), 1e-6) << trial;
    }
  }
}

TEST(MotionsFromHomography, NoneForARotationOrASingularMatrix) {
  const Eigen::Matrix3d K = calibration();
  const Eigen::Matrix3d R = testing::sideways_motion().rotation_matrix();
  EXPECT_TRUE(motions_from_homography(K * R * K.inverse(), K).empty());
  EXPECT_TRUE(motions_from_homography(Eigen::Matrix3d::Zero(), K).empty());
  // Moving along the plane's normal leaves the direction across undetermined.
  const Eigen::Matrix3d along =
      R + R * Eigen::Vector3d::UnitZ() * Eigen::RowVector3d::UnitZ() * 0.2;
  EXPECT_TRUE(motions_from_homography(K * along * K.inverse(), K).empty());
}

TEST(MotionsFromFundamental, ContainTheTrueMotionOnce) {
  std::mt19937_64 random(2);
  const Eigen::Matrix3d K = calibration();
  for (int trial = 0; trial < 200; ++trial) {
    const Pose T_21 = random_motion(random);
    const Eigen::Matrix3d F_21 = fundamental_matrix(T_21, Pose(), K, K);
    for (const double factor : {1.0, -2.0}) {
      const auto motions = motions_from_fundamental(factor * F_21, K);
      ASSERT_EQ(motions.size(), 4U);
      expect_proper(motions);
      EXPECT_LT(closest(motions, T_21), 1e-6);
      EXPECT_EQ(motions[0].t, -motions[2].t);
      EXPECT_EQ(motions[0].R, motions[2].R);
      EXPECT_EQ(motions[1].R, motions[3].R);
    }
  }
}

}  // namespace
}  // namespace orbslam
