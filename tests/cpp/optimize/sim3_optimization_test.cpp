// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/sim3_optimization.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include "golden.hpp"
#include "optimize/sim3_residuals.hpp"
#include "support/cameras.hpp"
#include "support/random_numbers.hpp"

namespace orbslam {
namespace {

using testing::uniform;

struct SimilarityProblem {
  Similarity S_12_true, S_12_initial;
  std::shared_ptr<const Camera> camera_1 = testing::make_camera({500, 510, 320, 240}),
                                camera_2 = testing::make_camera({480, 470, 300, 250});
  std::vector<SimilarityMatch> matches;
  std::vector<std::uint8_t> outlier;

  SimilarityEstimate solve(const SimilarityOptions& options = {}) const {
    return optimize_similarity(S_12_initial, *camera_1, *camera_2, matches, options);
  }
};

Vector7d random_tangent(std::mt19937_64& random, double size) {
  Vector7d delta;
  for (int i = 0; i < 7; ++i) delta(i) = uniform(random, -size, size);
  return delta;
}

/// Points 1 to 10 m before camera 1; `noise` [pixels] on the keypoints, and outliers far off in
/// one of the images.
SimilarityProblem random_sim3_problem(std::uint64_t seed, std::size_t n, double noise,
                                      double outliers) {
  std::mt19937_64 random(seed);
  SimilarityProblem problem;
  problem.S_12_true = Similarity::exp(random_tangent(random, 0.3));
  problem.S_12_initial = Similarity::exp(random_tangent(random, 0.02)) * problem.S_12_true;
  while (problem.matches.size() < n) {
    SimilarityMatch m;
    m.pixel_1 = {uniform(random, 0, 640), uniform(random, 0, 480)};
    m.point_1 = problem.camera_1->unproject(m.pixel_1.x(), m.pixel_1.y(), uniform(random, 1, 10));
    m.point_2 = problem.S_12_true.inverse() * m.point_1;
    if (m.point_2.z() < 0.5) continue;
    m.pixel_2 = problem.camera_2->pinhole().project(m.point_2);
    m.pixel_1 += Eigen::Vector2d(uniform(random, -noise, noise), uniform(random, -noise, noise));
    m.pixel_2 += Eigen::Vector2d(uniform(random, -noise, noise), uniform(random, -noise, noise));
    m.inverse_sigma2_1 = 1 / std::pow(1.44, static_cast<double>(problem.matches.size() % 3));
    m.inverse_sigma2_2 = 1 / std::pow(1.44, static_cast<double>(problem.matches.size() % 4));
    const bool outlier = uniform(random, 0, 1) < outliers;
    if (outlier) (problem.matches.size() % 2 == 0 ? m.pixel_1 : m.pixel_2).x() += 40;
    problem.outlier.push_back(outlier ? 1 : 0);
    problem.matches.push_back(m);
  }
  return problem;
}

double difference(const Similarity& a, const Similarity& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff();
}

/// Sum of squared residuals of the matches that are not outliers.
double cost_without(const SimilarityProblem& problem, const std::vector<std::uint8_t>& outlier,
                    const Similarity& S_12) {
  double sum = 0;
  for (std::size_t i = 0; i < problem.matches.size(); ++i) {
    if (outlier[i]) continue;
    const SimilarityMatch& m = problem.matches[i];
    sum += sim3_residuals::forward(S_12, *problem.camera_1, m)->error.squaredNorm() +
           sim3_residuals::inverse(S_12, *problem.camera_2, m)->error.squaredNorm();
  }
  return sum;
}

TEST(Sim3Residuals, DepthIsThatOfTheProjectedPoint) {
  std::mt19937_64 random(1);
  const auto camera = testing::make_camera({500, 510, 320, 240});
  for (const double depth : {-3.0, 0.5, 3.0, 50.0}) {
    const Similarity S_12 = Similarity::exp(random_tangent(random, 1));
    SimilarityMatch m;
    m.point_1 = S_12 * camera->unproject(100, 200, depth);
    m.point_2 = S_12.inverse() * camera->unproject(300, 50, depth);
    EXPECT_NEAR(sim3_residuals::forward(S_12, *camera, m)->depth, depth, 1e-9 * std::abs(depth));
    EXPECT_NEAR(sim3_residuals::inverse(S_12, *camera, m)->depth, depth, 1e-9 * std::abs(depth));
  }
}

TEST(OptimizeSimilarity, RecoversTheTruth) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const SimilarityProblem problem = random_sim3_problem(seed, 60, 0, 0.2);
    const SimilarityEstimate estimate = problem.solve();
    EXPECT_LT(difference(estimate.S_12, problem.S_12_true), 1e-6) << seed;
    EXPECT_EQ(estimate.outlier, problem.outlier) << seed;
  }
}

TEST(OptimizeSimilarity, OutliersAreThoseBeyondTheGateInEitherImage) {
  const SimilarityProblem problem = random_sim3_problem(3, 100, 2.5, 0.2);
  const SimilarityEstimate estimate = problem.solve();
  int inliers = 0;
  for (std::size_t i = 0; i < problem.matches.size(); ++i) {
    const SimilarityMatch& m = problem.matches[i];
    const Eigen::Vector2d error_1 =
        m.pixel_1 - problem.camera_1->pinhole().project(estimate.S_12 * m.point_2);
    const Eigen::Vector2d error_2 =
        m.pixel_2 - problem.camera_2->pinhole().project(estimate.S_12.inverse() * m.point_1);
    const bool beyond = error_1.squaredNorm() * m.inverse_sigma2_1 > 10 ||
                        error_2.squaredNorm() * m.inverse_sigma2_2 > 10;
    // One that failed before the last iterations stays out.
    EXPECT_TRUE(!beyond || estimate.outlier[i]);
    inliers += estimate.outlier[i] ? 0 : 1;
  }
  EXPECT_EQ(estimate.n_inliers, inliers);
  EXPECT_GT(inliers, 50);
}

TEST(OptimizeSimilarity, NoSmallMotionReducesTheError) {
  const SimilarityProblem problem = random_sim3_problem(4, 80, 1, 0);
  const std::vector<std::uint8_t> none(80, 0);
  const auto cost = [&](const Similarity& S_12) { return cost_without(problem, none, S_12); };
  for (const bool fix_scale : {false, true}) {
    SimilarityProblem start = problem;
    if (fix_scale) {
      start.S_12_initial = Similarity(problem.S_12_true.scale(), start.S_12_initial.rotation(),
                                      start.S_12_initial.translation());
    }
    const SimilarityEstimate estimate = start.solve({10, fix_scale});
    ASSERT_EQ(estimate.n_inliers, 80);
    for (int i = 0; i < (fix_scale ? 6 : 7); ++i) {
      for (const double step : {-1e-3, 1e-3}) {
        EXPECT_GT(cost(Similarity::exp(step * Vector7d::Unit(i)) * estimate.S_12),
                  cost(estimate.S_12));
      }
    }
  }
}

TEST(OptimizeSimilarity, FixedScaleDoesNotMove) {
  const SimilarityProblem problem = random_sim3_problem(5, 60, 1, 0);
  const SimilarityEstimate fixed = problem.solve({10, true});
  EXPECT_EQ(fixed.S_12.scale(), problem.S_12_initial.scale());
  EXPECT_GT(difference(fixed.S_12, problem.S_12_initial), 1e-4);
  EXPECT_NE(problem.solve().S_12.scale(), problem.S_12_initial.scale());
}

/// Of most matches one side is not known: they hold the motion, the others the scale.
TEST(OptimizeSimilarity, MatchesOfOneSideTakePart) {
  double with_all = 0;
  double with_few = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    SimilarityProblem problem = random_sim3_problem(seed, 60, 0, 0);
    SimilarityProblem noisy = random_sim3_problem(seed, 60, 1.0, 0);
    for (std::size_t i = 10; i < 60; ++i) {
      for (SimilarityMatch* match : {&problem.matches[i], &noisy.matches[i]}) {
        match->mutual = false;
        match->point_1.setConstant(std::numeric_limits<double>::quiet_NaN());
        match->pixel_2.setConstant(std::numeric_limits<double>::quiet_NaN());
      }
    }
    const SimilarityEstimate estimate = problem.solve();
    EXPECT_LT(difference(estimate.S_12, problem.S_12_true), 1e-6) << seed;
    EXPECT_EQ(estimate.n_inliers, 60) << seed;

    SimilarityProblem few = noisy;
    few.matches.resize(10);
    const auto turned_by = [](const SimilarityProblem& solved) {
      const Similarity off = solved.solve().S_12 * solved.S_12_true.inverse();
      return Eigen::AngleAxisd(off.rotation_matrix()).angle();
    };
    with_all += turned_by(noisy);
    with_few += turned_by(few);
  }
  EXPECT_LT(with_all, 0.7 * with_few);
}

TEST(OptimizeSimilarity, TooFewMatchesChangeNothing) {
  for (const std::size_t n : {0U, 1U, 9U}) {
    const SimilarityProblem problem = random_sim3_problem(6, n, 0, 0);
    const SimilarityEstimate estimate = problem.solve();
    EXPECT_EQ(estimate.n_inliers, 0);
    EXPECT_EQ(difference(estimate.S_12, problem.S_12_initial), 0);
  }
  EXPECT_EQ(random_sim3_problem(6, 10, 0, 0).solve().n_inliers, 10);
}

TEST(OptimizeSimilarity, PointsBehindACameraAndBrokenNumbersAreOutliers) {
  SimilarityProblem problem = random_sim3_problem(7, 60, 0, 0);
  // Mirrored through both cameras' centres, both pixels stay right without being seen.
  const Similarity S_21 = problem.S_12_true.inverse();
  for (std::size_t i = 0; i < 3; ++i) {
    problem.matches[i].point_1 *= -1;
    problem.matches[i].point_2 = S_21 * problem.matches[i].point_1;
    problem.matches[i].pixel_2 = problem.camera_2->pinhole().project(problem.matches[i].point_2);
  }
  problem.matches[3].point_1.x() = std::numeric_limits<double>::quiet_NaN();
  problem.matches[4].pixel_2.y() = std::numeric_limits<double>::infinity();
  const SimilarityEstimate estimate = problem.solve();
  EXPECT_LT(difference(estimate.S_12, problem.S_12_true), 1e-6);
  for (std::size_t i = 0; i < 60; ++i) EXPECT_EQ(estimate.outlier[i], i < 5 ? 1 : 0) << i;
}

TEST(OptimizeSimilarity, RefusesBadGates) {
  EXPECT_THROW(random_sim3_problem(8, 20, 0, 0).solve({0, false}), std::invalid_argument);
}

SimilarityProblem golden_problem() {
  const std::string set = "optsim3";
  const ScalePyramid scales(1.2F, 8);
  const auto array = [&](const char* name) { return testing::golden<double>(set, name); };
  SimilarityProblem problem;
  problem.camera_1 = problem.camera_2 = testing::golden_camera(array("K"));
  const Pose T_1w = testing::pose_at(array("T1w"), 0), T_2w = testing::pose_at(array("T2w"), 0);
  const auto X1 = array("X1w"), X2 = array("X2w"), uv1 = array("uv1"), uv2 = array("uv2");
  const auto octave1 = testing::golden<int>(set, "octave1");
  const auto octave2 = testing::golden<int>(set, "octave2");
  for (std::size_t i = 0; i < X1.rows(); ++i) {
    SimilarityMatch m;
    m.point_1 = T_1w * Eigen::Vector3d(X1.at(i, 0), X1.at(i, 1), X1.at(i, 2));
    m.point_2 = T_2w * Eigen::Vector3d(X2.at(i, 0), X2.at(i, 1), X2.at(i, 2));
    m.pixel_1 = {uv1.at(i, 0), uv1.at(i, 1)};
    m.pixel_2 = {uv2.at(i, 0), uv2.at(i, 1)};
    m.inverse_sigma2_1 = scales.inverse_sigma2(octave1.at(i));
    m.inverse_sigma2_2 = scales.inverse_sigma2(octave2.at(i));
    problem.matches.push_back(m);
  }
  return problem;
}

// With a free scale the reference stops short of the minimum: its exponential lacks a term for
// steps with a small rotation and a larger change of scale, so its last steps are refused. The
// scale it stops at is 8e-5 away; ours must be at a smaller error. (OD-113)
constexpr double kReferenceScaleError = 1e-4;

TEST(OptimizeSimilarity, AgreesWithTheReference) {
  const std::string set = "optsim3";
  const auto start = testing::golden<double>(set, "S12_init").values;
  Eigen::Matrix4d Rt = Eigen::Matrix4d::Identity();
  for (int i = 0; i < 12; ++i) Rt(i / 4, i % 4) = start[static_cast<std::size_t>(i)];
  for (const bool fix_scale : {false, true}) {
    const std::string name = fix_scale ? "out_fix1_" : "out_fix0_";
    SimilarityProblem problem = golden_problem();
    problem.S_12_initial = Similarity(fix_scale ? 1 : start[12], Pose::from_matrix(Rt).rotation(),
                                      Rt.topRightCorner<3, 1>());
    const SimilarityEstimate estimate = problem.solve({10, fix_scale});
    EXPECT_EQ(estimate.n_inliers, testing::golden<int>(set, name + "nin").values[0]);
    const auto inlier = testing::golden<std::uint8_t>(set, name + "inlier").values;
    for (std::size_t i = 0; i < inlier.size(); ++i) EXPECT_EQ(estimate.outlier[i], 1 - inlier[i]);

    const auto expected = testing::golden<double>(set, name + "Rt");
    Eigen::Matrix4d reference = Eigen::Matrix4d::Identity();
    for (int i = 0; i < 12; ++i) {
      reference(i / 4, i % 4) = expected.values[static_cast<std::size_t>(i)];
    }
    const double scale = testing::golden<double>(set, name + "s").values[0];
    const Similarity& S_12 = estimate.S_12;
    EXPECT_LT((S_12.rotation_matrix() - reference.topLeftCorner<3, 3>()).cwiseAbs().maxCoeff(),
              1e-5);
    EXPECT_LT((S_12.translation() - reference.topRightCorner<3, 1>()).cwiseAbs().maxCoeff(), 1e-5);
    EXPECT_NEAR(S_12.scale(), scale, fix_scale ? 1e-5 : kReferenceScaleError);
    if (fix_scale) continue;
    const Similarity theirs(scale, Pose::from_matrix(reference).rotation(),
                            reference.topRightCorner<3, 1>());
    EXPECT_LT(cost_without(problem, estimate.outlier, S_12),
              cost_without(problem, estimate.outlier, theirs));
  }
}

}  // namespace
}  // namespace orbslam
