// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/sim3_horn.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "sim3_problems.hpp"

namespace orbslam {
namespace {

using testing::normal;

Eigen::Matrix3Xd random_points(std::mt19937_64& random, Eigen::Index n) {
  Eigen::Matrix3Xd points(3, n);
  for (Eigen::Index i = 0; i < points.size(); ++i) points(i % 3, i / 3) = normal(random);
  return points;
}

Eigen::Matrix3Xd moved(const Similarity& S, const Eigen::Matrix3Xd& points) {
  Eigen::Matrix3Xd result(3, points.cols());
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    result.col(i) = S * Eigen::Vector3d(points.col(i));
  }
  return result;
}

double error(const Similarity& S, const Eigen::Matrix3Xd& to, const Eigen::Matrix3Xd& from) {
  return (to - moved(S, from)).squaredNorm();
}

// OD-100: also where the rotation is exactly the identity.
TEST(AlignSimilarity, RecoversExactMotions) {
  std::mt19937_64 random(1);
  constexpr double pi = 3.141592653589793;
  for (const Eigen::Index n : {3, 4, 20}) {
    for (const double scale : {0.1, 1.0, 10.0}) {
      for (const double angle : {0.0, 1e-9, 1e-3, 0.5, 2.0, 3.1, pi}) {
        for (int axis = 0; axis < 4; ++axis) {
          Eigen::Vector3d direction(1, -2, 0.5);
          if (axis < 3) direction = Eigen::Vector3d::Unit(axis);
          const Similarity S(scale,
                             Eigen::Quaterniond(Eigen::AngleAxisd(angle, direction.normalized())),
                             Eigen::Vector3d(0.3, -1, 2));
          const Eigen::Matrix3Xd from = random_points(random, n), to = moved(S, from);
          const auto free = align_similarity(to, from, false);
          ASSERT_TRUE(free);
          EXPECT_LT((free->matrix() - S.matrix()).norm(), 1e-9 * scale) << angle;
          if (scale == 1.0) {
            const auto fixed = align_similarity(to, from, true);
            ASSERT_TRUE(fixed);
            EXPECT_EQ(fixed->scale(), 1);
            EXPECT_LT((fixed->matrix() - S.matrix()).norm(), 1e-9) << angle;
          }
        }
      }
    }
  }
}

TEST(AlignSimilarity, NoSmallMotionReducesTheError) {
  std::mt19937_64 random(2);
  for (int repeat = 0; repeat < 20; ++repeat) {
    const Eigen::Matrix3Xd from = random_points(random, 8);
    const Similarity S(1.5, Eigen::Quaterniond(0.8, 0.1, -0.3, 0.4), Eigen::Vector3d(1, 2, 3));
    const Eigen::Matrix3Xd to = moved(S, from) + 0.1 * random_points(random, 8);
    for (const bool fix_scale : {false, true}) {
      const auto best = align_similarity(to, from, fix_scale);
      ASSERT_TRUE(best);
      const double least = error(*best, to, from);
      for (int i = 0; i < (fix_scale ? 6 : 7); ++i) {
        for (const double step : {-1e-3, 1e-3}) {
          EXPECT_GT(error(Similarity::exp(step * Vector7d::Unit(i)) * *best, to, from), least);
        }
      }
    }
  }
}

TEST(AlignSimilarity, RefusesCollinearPointsAndBrokenNumbers) {
  std::mt19937_64 random(3);
  const Eigen::Matrix3Xd good = random_points(random, 3);
  const Eigen::Vector3d p(1, 2, 3), d(0.2, -0.7, 0.4);
  Eigen::Matrix3Xd line(3, 3), point(3, 3), nearly(3, 3), broken = good;
  line << p, p + d, p + 3 * d;
  point << p, p, p;
  nearly = line;
  nearly(0, 1) += 1e-8;
  broken(1, 1) = std::numeric_limits<double>::quiet_NaN();
  for (const Eigen::Matrix3Xd& bad : {line, point, nearly, broken}) {
    for (const bool fix_scale : {false, true}) {
      EXPECT_FALSE(align_similarity(bad, good, fix_scale));
      EXPECT_FALSE(align_similarity(good, bad, fix_scale));
      EXPECT_FALSE(align_similarity(bad, bad, fix_scale));
    }
  }
  nearly(0, 1) += 1e-3;
  EXPECT_TRUE(align_similarity(nearly, nearly, false));
}

TEST(AlignSimilarity, RefusesTooFewOrUnequalSets) {
  const Eigen::Matrix3Xd two = Eigen::Matrix3Xd::Zero(3, 2), four = Eigen::Matrix3Xd::Zero(3, 4);
  EXPECT_THROW(align_similarity(two, two, false), std::invalid_argument);
  EXPECT_THROW(align_similarity(four, two, false), std::invalid_argument);
}

class AlignSimilarityGolden : public ::testing::TestWithParam<const char*> {};

// In single precision the reference errs by 2e-5 on the thin triangle of one sample (its height is
// 4 % of its length): 1e-5 cannot be asked there, but the true rotation can.
bool thin(const std::string& set, std::size_t sample) { return set == "sim3solver" && sample == 8; }

TEST_P(AlignSimilarityGolden, TriplesAgreeWithTheReference) {
  const std::string set = GetParam();
  const Sim3Problem problem = testing::golden_sim3_problem(set);
  const auto triples = testing::golden<int>(set, "triples");
  const auto truth = testing::golden<double>(set, "S12_true").values;
  const Sim3Ransac ransac(problem, {}, 0);
  for (const bool fix_scale : {false, true}) {
    const auto expected =
        testing::golden<double>(set, fix_scale ? "out_fix1_triples" : "out_fix0_triples");
    for (std::size_t i = 0; i < triples.rows(); ++i) {
      Eigen::Matrix3d points_1, points_2;
      for (int k = 0; k < 3; ++k) {
        const int column = triples.at(i, static_cast<std::size_t>(k));
        points_1.col(k) = problem.points_1.col(column);
        points_2.col(k) = problem.points_2.col(column);
      }
      const auto S_12 = align_similarity(points_1, points_2, fix_scale);
      ASSERT_TRUE(S_12);
      const Eigen::Matrix3d R = S_12->rotation_matrix();
      const double tolerance = thin(set, i) ? 2e-4 : 1e-5;
      for (std::size_t k = 0; k < 9; ++k) {
        const double entry = R(static_cast<int>(k / 3), static_cast<int>(k % 3));
        EXPECT_NEAR(entry, expected.at(i, k), tolerance) << i;
        EXPECT_NEAR(entry, truth[4 * (k / 3) + k % 3], 2e-6) << i;
      }
      for (int k = 0; k < 3; ++k) {
        EXPECT_NEAR(S_12->translation()(k), expected.at(i, static_cast<std::size_t>(9 + k)),
                    tolerance)
            << i;
      }
      EXPECT_NEAR(S_12->scale(), expected.at(i, 12), 1e-5) << i;
      EXPECT_EQ(ransac.judge(*S_12).n_inliers, static_cast<std::size_t>(expected.at(i, 13))) << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Sets, AlignSimilarityGolden,
                         ::testing::Values("sim3solver", "sim3solver_s1"));

}  // namespace
}  // namespace orbslam
