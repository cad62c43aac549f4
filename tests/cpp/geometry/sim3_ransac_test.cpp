// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/sim3_ransac.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <stdexcept>

#include "sim3_problems.hpp"

namespace orbslam {
namespace {

using testing::make_sim3_problem;
using testing::SyntheticSim3;

std::optional<Sim3Estimate> run(Sim3Ransac& ransac, int slice) {
  while (!ransac.exhausted()) {
    if (auto estimate = ransac.iterate(slice)) return estimate;
  }
  return std::nullopt;
}

int successes(double outlier_share) {
  int count = 0;
  for (std::uint64_t seed = 0; seed < 1000; ++seed) {
    const SyntheticSim3 synthetic = make_sim3_problem(80, 1.3, 0.01, outlier_share, seed);
    Sim3Ransac ransac(synthetic.problem, {}, seed);
    const auto estimate = run(ransac, 5);
    if (!estimate) continue;
    const Vector7d error = (estimate->S_12 * synthetic.S_12.inverse()).log();
    count += error.head<3>().norm() < 0.05 && std::abs(error(6)) < 0.05 ? 1 : 0;
  }
  return count;
}

TEST(Sim3Ransac, SuccessRatesWithOutliers) {
  EXPECT_GE(successes(0.3), 980);  // measured 1000
  EXPECT_GE(successes(0.6), 660);  // measured 691
}

TEST(Sim3Ransac, InliersAreThoseWithinTheGatesInFront) {
  SyntheticSim3 synthetic = make_sim3_problem(80, 0.7, 0.02, 0.2, 3);
  Sim3Problem& p = synthetic.problem;
  for (int i = 0; i < 80; ++i) {
    p.sigma2_1[i] = 1 + i % 3;
    p.sigma2_2[i] = 1 + i % 4;
  }
  const Similarity& S_12 = synthetic.S_12;
  const Sim3Estimate estimate = Sim3Ransac(p, {}, 1).judge(S_12);
  std::size_t count = 0;
  int only_1 = 0, only_2 = 0;
  for (int i = 0; i < 80; ++i) {
    const Eigen::Vector3d X_1 = p.points_1.col(i), X_2 = p.points_2.col(i);
    const Eigen::Vector3d in_1 = S_12 * X_2, in_2 = S_12.inverse() * X_1;
    const double error_1 =
        (p.camera_1->pinhole().project(in_1) - p.camera_1->pinhole().project(X_1)).squaredNorm();
    const double error_2 =
        (p.camera_2->pinhole().project(in_2) - p.camera_2->pinhole().project(X_2)).squaredNorm();
    const bool near_1 = in_1.z() > 0 && error_1 < 9.210 * p.sigma2_1[i];
    const bool near_2 = in_2.z() > 0 && error_2 < 9.210 * p.sigma2_2[i];
    EXPECT_EQ(estimate.inliers[static_cast<std::size_t>(i)] != 0, near_1 && near_2);
    count += near_1 && near_2 ? 1 : 0;
    only_1 += near_1 && !near_2 ? 1 : 0;
    only_2 += near_2 && !near_1 ? 1 : 0;
  }
  EXPECT_EQ(estimate.n_inliers, count);
  EXPECT_GT(count, 30U);
  EXPECT_GT(only_1, 0);  // so that either gate was put to the test
  EXPECT_GT(only_2, 0);
}

// OD-101: inliers lie in front of both cameras.
TEST(Sim3Ransac, PointsBehindACameraAreNoInliers) {
  SyntheticSim3 synthetic = make_sim3_problem(60, 1, 0, 0, 4);
  // A point mirrored through the centre of its camera keeps its pixel there.
  synthetic.problem.points_1.leftCols(10) *= -1;
  synthetic.problem.points_2.middleCols(10, 10) *= -1;
  // Both of these, exactly where the similarity says, but behind the cameras.
  const Similarity S_21 = synthetic.S_12.inverse();
  for (int i = 20; i < 30; ++i) {
    synthetic.problem.points_1.col(i) *= -1;
    synthetic.problem.points_2.col(i) = S_21 * Eigen::Vector3d(synthetic.problem.points_1.col(i));
  }
  const Sim3Estimate estimate = Sim3Ransac(synthetic.problem, {}, 1).judge(synthetic.S_12);
  for (std::size_t i = 0; i < 60; ++i) EXPECT_EQ(estimate.inliers[i], i < 30 ? 0 : 1) << i;
}

// OD-98: the gates are real numbers.
TEST(Sim3Ransac, GatesAreNotRounded) {
  SyntheticSim3 synthetic = make_sim3_problem(60, 1, 0, 0, 5);
  Sim3Problem& p = synthetic.problem;
  p.points_2 = p.points_1;
  p.camera_2 = p.camera_1;
  // Squared errors of 9.1 in image 1, between 9 and 9.210.
  const double shift = std::sqrt(9.1) / p.camera_1->pinhole().fx;
  p.sigma2_2.setConstant(100);
  for (int i = 0; i < 60; ++i) p.points_2(0, i) += shift * p.points_2(2, i);
  EXPECT_EQ(Sim3Ransac(p, {}, 1).judge(Similarity()).n_inliers, 60U);
  p.sigma2_1.setConstant(0.98);
  EXPECT_EQ(Sim3Ransac(p, {}, 1).judge(Similarity()).n_inliers, 0U);
}

// OD-102: every candidate has its own seeded generator.
TEST(Sim3Ransac, SlicesDoNotChangeTheResultNorDoRepetitions) {
  int found = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const SyntheticSim3 synthetic = make_sim3_problem(50, 1.2, 0.01, 0.4, seed);
    Sim3Ransac whole(synthetic.problem, {}, seed), sliced(synthetic.problem, {}, seed),
        single(synthetic.problem, {}, seed);
    const auto a = whole.iterate(whole.max_iterations()), b = run(sliced, 5), c = run(single, 1);
    ASSERT_EQ(a.has_value(), b.has_value());
    ASSERT_EQ(a.has_value(), c.has_value());
    EXPECT_EQ(whole.iterations(), sliced.iterations());
    if (!a) continue;
    ++found;
    for (const auto& other : {b, c}) {
      const Eigen::Matrix4d S_a = a->S_12.matrix(), S_b = other->S_12.matrix();
      EXPECT_EQ(std::memcmp(S_a.data(), S_b.data(), sizeof(S_a)), 0);
      EXPECT_EQ(a->inliers, other->inliers);
    }
  }
  EXPECT_GT(found, 10);
}

TEST(Sim3Ransac, CallRunsAtMostTheIterationsAskedFor) {
  // 40 correspondences, 20 needed: 35 iterations. There is nothing to find.
  Sim3Ransac ransac(make_sim3_problem(40, 1, 0, 1.0, 1).problem, {}, 1);
  EXPECT_EQ(ransac.max_iterations(), 35);
  EXPECT_FALSE(ransac.iterate(5));
  EXPECT_EQ(ransac.iterations(), 5);
  EXPECT_FALSE(ransac.exhausted());
  EXPECT_FALSE(ransac.iterate(1000));
  EXPECT_EQ(ransac.iterations(), 35);
  EXPECT_TRUE(ransac.exhausted());
  EXPECT_FALSE(ransac.iterate(5));
  EXPECT_EQ(ransac.iterations(), 35);
}

TEST(Sim3Ransac, IterationsFollowFromTheCorrespondences) {
  const auto iterations = [](int n) {
    return Sim3Ransac(make_sim3_problem(n, 1, 0, 0, 1).problem, {}, 1).max_iterations();
  };
  EXPECT_EQ(iterations(0), 0);
  EXPECT_EQ(iterations(19), 0);  // exhausted at once
  EXPECT_EQ(iterations(20), 1);
  EXPECT_EQ(iterations(40), 35);
  EXPECT_EQ(iterations(60), 123);
  EXPECT_EQ(iterations(81), 300);
  EXPECT_EQ(iterations(500), 300);
}

TEST(Sim3Ransac, MoreThanTheLeastNumberOfInliersIsNeeded) {
  Sim3Ransac twenty(make_sim3_problem(20, 1, 0, 0, 1).problem, {}, 1);
  EXPECT_FALSE(run(twenty, 5));
  Sim3Ransac one_more(make_sim3_problem(21, 1, 0, 0, 1).problem, {}, 1);
  const auto estimate = run(one_more, 5);
  ASSERT_TRUE(estimate);
  EXPECT_EQ(estimate->n_inliers, 21U);
}

TEST(Sim3Ransac, GoesOnBehindAResult) {
  Sim3Ransac ransac(make_sim3_problem(60, 1.1, 0, 0, 1).problem, {}, 1);
  for (int i = 1; i <= 10; ++i) {
    EXPECT_TRUE(ransac.iterate(5));
    EXPECT_EQ(ransac.iterations(), i);
  }
}

TEST(Sim3Ransac, CollinearSamplesCountAndGiveNoResult) {
  SyntheticSim3 synthetic = make_sim3_problem(40, 1, 0, 0, 1);
  for (int i = 0; i < 40; ++i) {
    synthetic.problem.points_1.col(i) << 0.1 * i, 0, 5;
    synthetic.problem.points_2.col(i) << 0.1 * i, 0, 5;
  }
  Sim3Ransac ransac(synthetic.problem, {}, 1);
  EXPECT_FALSE(run(ransac, 5));
  EXPECT_EQ(ransac.iterations(), 35);
}

TEST(Sim3Ransac, BrokenNumbersAreNoInliers) {
  SyntheticSim3 synthetic = make_sim3_problem(60, 1, 0, 0, 2);
  synthetic.problem.points_1(0, 7) = std::numeric_limits<double>::quiet_NaN();
  synthetic.problem.points_2(2, 9) = std::numeric_limits<double>::infinity();
  Sim3Ransac ransac(synthetic.problem, {}, 1);
  const auto estimate = run(ransac, 5);
  ASSERT_TRUE(estimate);
  EXPECT_TRUE(estimate->S_12.matrix().allFinite());
  EXPECT_EQ(estimate->n_inliers, 58U);
}

TEST(Sim3Ransac, RefusesBadArguments) {
  Sim3Problem problem = make_sim3_problem(30, 1, 0, 0, 1).problem;
  Sim3Options options;
  options.ransac.probability = 1;
  EXPECT_THROW(Sim3Ransac(problem, options, 1), std::invalid_argument);
  problem.sigma2_2.conservativeResize(29);
  EXPECT_THROW(Sim3Ransac(problem, {}, 1), std::invalid_argument);
}

class Sim3RansacGolden : public ::testing::TestWithParam<const char*> {};

TEST_P(Sim3RansacGolden, AgreesWithTheReference) {
  const std::string set = GetParam();
  for (const bool fix_scale : {false, true}) {
    const std::string name = fix_scale ? "out_fix1_" : "out_fix0_";
    Sim3Options options;
    options.fix_scale = fix_scale;
    Sim3Ransac ransac(testing::golden_sim3_problem(set), options, 0);
    const auto estimate = ransac.iterate(5);
    ASSERT_EQ(estimate.has_value(), testing::golden<int>(set, name + "ok").values[0] != 0);
    if (!estimate) continue;
    EXPECT_EQ(static_cast<int>(estimate->n_inliers),
              testing::golden<int>(set, name + "ninliers").values[0]);
    EXPECT_EQ(estimate->inliers, testing::golden<std::uint8_t>(set, name + "inlier").values);
    // Another sample of exact correspondences in float32, so the same up to their rounding.
    const auto T = testing::golden<double>(set, name + "T12");
    for (std::size_t i = 0; i < 16; ++i) {
      EXPECT_NEAR(estimate->S_12.matrix()(static_cast<int>(i / 4), static_cast<int>(i % 4)),
                  T.values[i], 2e-5);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Sets, Sim3RansacGolden, ::testing::Values("sim3solver", "sim3solver_s1"));

}  // namespace
}  // namespace orbslam
