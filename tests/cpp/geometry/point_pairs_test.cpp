// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/point_pairs.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

#include "scenes.hpp"

namespace orbslam {
namespace {

using Points = std::vector<Eigen::Vector2f>;

TEST(GatherPairs, TakesTheMatchedOnesInOrder) {
  const Points initial{{1, 2}, {3, 4}, {5, 6}}, current{{7, 8}, {9, 10}};
  const PointPairs pairs = gather_pairs(initial, current, {1, -1, 0});
  ASSERT_EQ(pairs.size(), 2U);
  EXPECT_EQ(pairs.u_1[0], 1);
  EXPECT_EQ(pairs.v_2[0], 10);
  EXPECT_EQ(pairs.v_1[1], 6);
  EXPECT_EQ(pairs.u_2[1], 7);
}

TEST(GatherPairs, RefusesMatchesThatDoNotFit) {
  const Points initial{{1, 2}, {3, 4}}, current{{7, 8}};
  EXPECT_THROW(gather_pairs(initial, current, {0}), std::invalid_argument);
  EXPECT_THROW(gather_pairs(initial, current, {0, 1}), std::invalid_argument);
}

TEST(Normalize, GivesMeanZeroAndDeviationOne) {
  std::mt19937_64 random(1);
  Points points;
  for (int i = 0; i < 100; ++i) {
    points.emplace_back(static_cast<float>(testing::uniform(random, 0, 640)),
                        static_cast<float>(testing::uniform(random, 100, 300)));
  }
  Normalization normalization;
  ASSERT_TRUE(normalize(points, normalization));
  Eigen::Array2d mean = Eigen::Array2d::Zero(), deviation = Eigen::Array2d::Zero();
  for (const auto& p : points) {
    const Eigen::Array2d q(normalization.u(p.x()), normalization.v(p.y()));
    mean += q / 100;
    deviation += q.abs() / 100;
    const Eigen::Vector3d by_matrix =
        normalization.matrix() * p.cast<double>().homogeneous().eval();
    EXPECT_NEAR((by_matrix.head<2>().array() - q).abs().maxCoeff(), 0, 1e-12);
  }
  EXPECT_LT(mean.abs().maxCoeff(), 1e-9);
  EXPECT_LT((deviation - 1).abs().maxCoeff(), 1e-9);
  EXPECT_LT((normalization.matrix() * normalization.inverse() - Eigen::Matrix3d::Identity()).norm(),
            1e-12);
}

// OD-67: points in one column or row would divide by 0.
TEST(Normalize, RefusesPointsWithoutExtent) {
  Normalization normalization;
  EXPECT_FALSE(normalize({}, normalization));
  EXPECT_FALSE(normalize({{5, 5}}, normalization));
  EXPECT_FALSE(normalize({{5, 1}, {5, 2}, {5, 3}}, normalization));
  EXPECT_FALSE(normalize({{1, 5}, {2, 5}, {3, 5}}, normalization));
}

}  // namespace
}  // namespace orbslam
