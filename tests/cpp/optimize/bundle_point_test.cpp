// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/bundle_point.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <array>
#include <cmath>

namespace orbslam {
namespace {

const Eigen::Vector3d kPlace(0.5, -1, 2), kStart(1, 2, 7);

Eigen::Vector3d moved(std::array<double, 3> parameters) {
  BundlePoint point(kPlace, kStart);
  point.move(parameters.data());
  return point.position();
}

TEST(BundlePoint, BeginsAtItsStart) {
  EXPECT_TRUE(BundlePoint(kPlace, kStart).position().isApprox(kStart, 1e-15));
}

TEST(BundlePoint, TheThirdParameterIsTheChangeOfTheInverseDepth) {
  EXPECT_TRUE(moved({0, 0, 1}).isApprox(0.5 * (kPlace + kStart), 1e-15));
  EXPECT_TRUE(moved({0, 0, -0.5}).isApprox(kPlace + 2 * (kStart - kPlace), 1e-15));
}

TEST(BundlePoint, TheOthersAreSlopes) {
  const double distance = (kStart - kPlace).norm();
  const Eigen::Vector3d a = moved({0.1, 0, 0}) - kStart, b = moved({0, 0.1, 0}) - kStart;
  EXPECT_NEAR(a.norm(), 0.1 * distance, 1e-12);
  EXPECT_NEAR(b.norm(), 0.1 * distance, 1e-12);
  EXPECT_NEAR(a.dot(b), 0, 1e-12);
  EXPECT_NEAR(a.dot(kStart - kPlace), 0, 1e-12);
  EXPECT_NEAR(b.dot(kStart - kPlace), 0, 1e-12);
}

TEST(BundlePoint, JacobianIsThatOfThePosition) {
  for (const double r : {1.3, 0.0, -0.3, -0.7, -2.0}) {
    const std::array<double, 3> at{0.05, -0.1, r};
    BundlePoint point(kPlace, kStart);
    point.move(at.data());
    for (int i = 0; i < 3; ++i) {
      const double step = 1e-6;
      std::array<double, 3> more = at, less = at;
      more[static_cast<std::size_t>(i)] += step;
      less[static_cast<std::size_t>(i)] -= step;
      const Eigen::Vector3d numeric = (moved(more) - moved(less)) / (2 * step);
      EXPECT_LT((numeric - point.jacobian().col(i)).norm(), 1e-7 * (1 + numeric.norm())) << r;
    }
  }
}

TEST(BundlePoint, StaysBeforeThePlaceAndFinite) {
  double last = 0;
  for (const double r : {-0.4, -0.5, -0.6, -1.0, -2.0, -2.5}) {
    const double along = (moved({0, 0, r}) - kPlace).dot(kStart - kPlace);
    EXPECT_GT(along, last);
    last = along;
  }
  EXPECT_EQ(moved({0, 0, -1e9}), moved({0, 0, -2.5}));
  BundlePoint point(kPlace, kStart);
  const double beyond[] = {0.0, 0.0, -1e9};
  point.move(beyond);
  EXPECT_EQ(point.jacobian().col(2).norm(), 0);  // only across
  EXPECT_GT(point.jacobian().col(0).norm(), 0);
}

TEST(BundlePoint, APointAtThePlaceIsSeenFromElsewhere) {
  const BundlePoint point(kStart, kStart);
  EXPECT_TRUE(point.position().isApprox(kStart, 1e-15));
  EXPECT_GT(std::abs(point.jacobian().determinant()), 0.5);
}

}  // namespace
}  // namespace orbslam
