// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/triangulation.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <limits>
#include <random>

#include "support/random_numbers.hpp"

namespace orbslam {
namespace {

using testing::uniform;

Pose random_pose(std::mt19937_64& random, double size) {
  Vector6d xi;
  for (int i = 0; i < 6; ++i) xi(i) = uniform(random, -size, size);
  return Pose::exp(xi);
}

Eigen::Vector3d ray_of(const Pose& T_cw, const Eigen::Vector3d& point) {
  const Eigen::Vector3d p_c = T_cw * point;
  return p_c / p_c.z();
}

TEST(Triangulate, RecoversExactPoints) {
  std::mt19937_64 random(1);
  for (int trial = 0; trial < 200; ++trial) {
    const Pose T_1w = random_pose(random, 0.5), T_2w = random_pose(random, 0.5);
    const Eigen::Vector3d point(uniform(random, -2, 2), uniform(random, -2, 2),
                                uniform(random, 3, 20));
    const auto found = triangulate(ray_of(T_1w, point), ray_of(T_2w, point), T_1w, T_2w);
    ASSERT_TRUE(found);
    EXPECT_LT((*found - point).norm(), 1e-8 * point.norm());
  }
}

TEST(Triangulate, DoesNotDependOnTheOrderOfCameras) {
  std::mt19937_64 random(2);
  const Pose T_1w = random_pose(random, 0.3), T_2w = random_pose(random, 0.3);
  const Eigen::Vector3d ray_1(0.1, -0.2, 1), ray_2(0.12, -0.19, 1);  // do not meet exactly
  const auto a = triangulate(ray_1, ray_2, T_1w, T_2w);
  const auto b = triangulate(ray_2, ray_1, T_2w, T_1w);
  ASSERT_TRUE(a && b);
  EXPECT_LT((*a - *b).norm(), 1e-9 * a->norm());
}

TEST(Triangulate, MinimisesTheAlgebraicError) {
  std::mt19937_64 random(3);
  const Pose T_1w, T_2w(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-0.5, 0, 0));
  const Eigen::Vector3d ray_1(0.1, 0.05, 1), ray_2(0.02, 0.051, 1);
  const auto found = triangulate(ray_1, ray_2, T_1w, T_2w);
  ASSERT_TRUE(found);
  const auto error = [&](Eigen::Vector4d homogeneous) {
    homogeneous.normalize();
    double sum = 0;
    for (const auto& [ray, pose] : {std::pair(ray_1, T_1w), std::pair(ray_2, T_2w)}) {
      const Eigen::Vector3d p = (pose.matrix() * homogeneous).head<3>();
      sum += std::pow(ray.x() * p.z() - p.x(), 2) + std::pow(ray.y() * p.z() - p.y(), 2);
    }
    return sum;
  };
  const Eigen::Vector4d best = found->homogeneous();
  for (int trial = 0; trial < 100; ++trial) {
    Eigen::Vector4d other = best;
    for (int i = 0; i < 4; ++i) other(i) += uniform(random, -0.05, 0.05);
    EXPECT_GE(error(other), error(best));
  }
}

TEST(Triangulate, ParallelRaysGiveNothingOrAVeryFarPoint) {
  const Pose T_1w, T_2w(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-1, 0, 0));
  const Eigen::Vector3d ray(0, 0, 1);
  const auto found = triangulate(ray, ray, T_1w, T_2w);
  if (found) {
    EXPECT_GT(found->norm(), 1e10);
  }
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(triangulate({nan, 0, 1}, ray, T_1w, T_2w));
}

TEST(FundamentalMatrix, MatchesTriangulatedPairs) {
  std::mt19937_64 random(4);
  Eigen::Matrix3d K_1, K_2;
  K_1 << 500, 0, 320, 0, 510, 240, 0, 0, 1;
  K_2 << 400, 0, 300, 0, 410, 200, 0, 0, 1;
  for (int trial = 0; trial < 100; ++trial) {
    const Pose T_1w = random_pose(random, 0.5), T_2w = random_pose(random, 0.5);
    const Eigen::Matrix3d F_12 = fundamental_matrix(T_1w, T_2w, K_1, K_2);
    const Eigen::Vector3d point(uniform(random, -2, 2), uniform(random, -2, 2),
                                uniform(random, 3, 20));
    const Eigen::Vector3d x_1 = K_1 * ray_of(T_1w, point), x_2 = K_2 * ray_of(T_2w, point);
    const Eigen::Vector3d line = F_12 * x_2;
    EXPECT_LT(std::abs(x_1.dot(line)) / line.head<2>().norm(), 1e-8);  // pixels
    EXPECT_NEAR(F_12.determinant(), 0, 1e-12);
    EXPECT_GT(F_12.norm(), 0);
  }
}

}  // namespace
}  // namespace orbslam
