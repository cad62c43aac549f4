// SPDX-License-Identifier: BSD-3-Clause
#include "base/covariance.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace orbslam {
namespace {

Matrix6d some_covariance() {
  Matrix6d root = Matrix6d::Identity();
  root(1, 0) = 0.5;
  root(4, 2) = -2;
  root(5, 3) = 1;
  return root * root.transpose();
}

TEST(Covariance, PositionDeviationIsOfTheTranslationAlone) {
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal() << 100, 100, 100, 4, 4, 1;
  covariance(0, 3) = covariance(3, 0) = 7;
  EXPECT_EQ(position_deviation(covariance), 3);
}

TEST(Covariance, PositionDeviationOfNothingIsNone) {
  EXPECT_EQ(position_deviation(Matrix6d::Zero()), 0);
  EXPECT_EQ(position_deviation(-Matrix6d::Identity()), 0);
}

TEST(Covariance, OneThatIsWidenedByNothingStaysAsItIs) {
  EXPECT_EQ(widened_covariance(some_covariance(), 1, {}), some_covariance());
}

TEST(Covariance, ErrorsAddTheirSquaresAlongThemselves) {
  const Matrix6d covariance = some_covariance();
  Vector6d first, second;
  first << 1, -2, 0, 3, 0.5, 0;
  second << 0, 0, 4, 0, 0, -1;
  const Matrix6d widened = widened_covariance(covariance, 3, {first, second});
  // The variance along any direction: three times the old one, and the squares of both shares.
  for (int k = 0; k < 6; ++k) {
    Vector6d along = Vector6d::Unit(k);
    along((k + 2) % 6) = 0.25;
    const double expected = 3 * along.dot(covariance * along) + std::pow(along.dot(first), 2) +
                            std::pow(along.dot(second), 2);
    EXPECT_NEAR(along.dot(widened * along), expected, 1e-12);
  }
  EXPECT_EQ(widened, widened.transpose().eval());
}

}  // namespace
}  // namespace orbslam
