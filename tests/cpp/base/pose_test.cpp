// SPDX-License-Identifier: BSD-3-Clause
#include "base/pose.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "support/random_numbers.hpp"

namespace orbslam {
namespace {

using testing::draw;

Vector6d random_tangent(std::mt19937_64& generator, double angle) {
  Eigen::Vector3d axis;
  for (int i = 0; i < 3; ++i) axis[i] = draw(generator, 1.0);
  Vector6d xi;
  xi << angle * axis.normalized(), draw(generator, 5), draw(generator, 5), draw(generator, 5);
  return xi;
}

/// exp of the 4x4 matrix of the tangent vector, by scaling and squaring of its power series.
Eigen::Matrix4d series_exp(const Vector6d& xi) {
  Eigen::Matrix4d generator = Eigen::Matrix4d::Zero();
  generator.topLeftCorner<3, 3>() = skew(xi.head<3>());
  generator.topRightCorner<3, 1>() = xi.tail<3>();
  generator /= 1024;
  Eigen::Matrix4d sum = Eigen::Matrix4d::Identity(), term = Eigen::Matrix4d::Identity();
  for (int k = 1; k < 12; ++k) {
    term = (term * generator / k).eval();
    sum += term;
  }
  for (int i = 0; i < 10; ++i) sum = (sum * sum).eval();
  return sum;
}

constexpr double rotation_angles[] = {0,      1e-12, 1e-9, 1e-7, 9e-5, 1.1e-4, 9e-4,
                                      1.1e-3, 0.1,   1,    2,    3,    3.14};

// OD-113: also for tiny angles.
TEST(Pose, ExpAgreesWithThePowerSeries) {
  std::mt19937_64 generator(1);
  for (const double angle : rotation_angles) {
    const Vector6d xi = random_tangent(generator, angle);
    EXPECT_TRUE(Pose::exp(xi).matrix().isApprox(series_exp(xi), 1e-11)) << angle;
  }
}

TEST(Pose, LogInvertsExp) {
  std::mt19937_64 generator(2);
  for (const double angle : rotation_angles) {
    for (int repeat = 0; repeat < 10; ++repeat) {
      const Vector6d xi = random_tangent(generator, angle);
      EXPECT_LT((Pose::exp(xi).log() - xi).norm(), 1e-9) << angle;
    }
  }
}

TEST(Pose, LogOfTheOtherQuaternionIsTheSame) {
  const Pose pose = Pose::exp((Vector6d() << 0.3, -0.4, 0.5, 1, 2, 3).finished());
  const Eigen::Quaterniond negated(-pose.rotation().coeffs());
  EXPECT_TRUE(Pose(negated, pose.translation()).log().isApprox(pose.log(), 1e-12));
}

TEST(Pose, GroupAxioms) {
  std::mt19937_64 generator(3);
  for (int repeat = 0; repeat < 20; ++repeat) {
    const Pose a = Pose::exp(random_tangent(generator, 2)),
               b = Pose::exp(random_tangent(generator, 1)),
               c = Pose::exp(random_tangent(generator, 3));
    EXPECT_TRUE(((a * b) * c).matrix().isApprox((a * (b * c)).matrix(), 1e-12));
    EXPECT_TRUE((a * b).matrix().isApprox(a.matrix() * b.matrix(), 1e-12));
    EXPECT_TRUE((a * a.inverse()).matrix().isIdentity(1e-12));
    EXPECT_TRUE((a.inverse() * a).matrix().isIdentity(1e-12));
    const Eigen::Vector3d point(1, -2, 3);
    EXPECT_TRUE((a * (b * point)).isApprox((a * b) * point, 1e-12));
  }
}

TEST(Pose, CenterIsMappedToTheOrigin) {
  std::mt19937_64 generator(4);
  const Pose T_cw = Pose::exp(random_tangent(generator, 1.5));
  EXPECT_LT((T_cw * T_cw.center()).norm(), 1e-12);
  EXPECT_TRUE(T_cw.center().isApprox(T_cw.inverse().translation(), 1e-12));
}

TEST(Pose, FromMatrixProjectsTheRotation) {
  std::mt19937_64 generator(5);
  for (int repeat = 0; repeat < 20; ++repeat) {
    const Pose pose = Pose::exp(random_tangent(generator, 2.5));
    Eigen::Matrix4d noisy = pose.matrix();
    for (int i = 0; i < 9; ++i) noisy(i / 3, i % 3) += draw(generator, 1e-3);
    const Pose projected = Pose::from_matrix(noisy);
    const Eigen::Matrix3d rotation = projected.rotation_matrix();
    EXPECT_TRUE((rotation * rotation.transpose()).isIdentity(1e-12));
    EXPECT_NEAR(rotation.determinant(), 1, 1e-12);
    EXPECT_TRUE(projected.matrix().isApprox(pose.matrix(), 5e-3));
    EXPECT_TRUE(Pose::from_matrix(pose.matrix()).matrix().isApprox(pose.matrix(), 1e-12));
  }
}

TEST(Pose, ConstructorsNormalise) {
  const Eigen::Quaterniond twice(2 * std::cos(0.3), 0, 2 * std::sin(0.3), 0);
  EXPECT_NEAR(Pose(twice, Eigen::Vector3d::Zero()).rotation().norm(), 1, 1e-15);
}

TEST(Skew, IsTheCrossProduct) {
  const Eigen::Vector3d v(1, 2, 3), w(-4, 5, 0.5);
  EXPECT_TRUE((skew(v) * w).isApprox(v.cross(w)));
}

}  // namespace
}  // namespace orbslam
