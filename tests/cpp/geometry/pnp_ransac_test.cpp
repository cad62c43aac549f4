// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/pnp_ransac.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "pnp_problems.hpp"

namespace orbslam {
namespace {

using testing::make_pnp_problem;
using testing::PnpShape;
using testing::SyntheticPnp;

std::optional<PnpPose> run(PnpRansac& ransac, int slice) {
  while (!ransac.exhausted()) {
    if (auto pose = ransac.iterate(slice)) return pose;
  }
  return std::nullopt;
}

bool close_to_truth(const PnpPose& pose, const SyntheticPnp& synthetic) {
  return testing::rotation_error_degrees(pose.T_cw, synthetic.T_cw) < 1.0 &&
         (pose.T_cw.center() - synthetic.T_cw.center()).norm() < 0.1;
}

int successes(double outlier_share, double inlier_ratio) {
  int count = 0;
  for (std::uint64_t seed = 0; seed < 1000; ++seed) {
    const auto synthetic = make_pnp_problem(PnpShape::general, 60, 1, outlier_share, seed);
    PnpOptions options;
    options.ransac.inlier_ratio = inlier_ratio;
    PnpRansac ransac(synthetic.problem, options, seed);
    const auto pose = run(ransac, 5);
    count += pose && close_to_truth(*pose, synthetic) ? 1 : 0;
  }
  return count;
}

TEST(PnpRansac, SuccessRatesWithOutliers) {
  EXPECT_GE(successes(0.3, 0.5), 800);  // measured 824
  EXPECT_GE(successes(0.6, 0.3), 560);  // measured 592
}

TEST(PnpRansac, InliersAreThoseWithinTheGateInFront) {
  const auto synthetic = make_pnp_problem(PnpShape::general, 80, 1, 0.2, 3);
  SyntheticPnp scaled = synthetic;
  for (int i = 0; i < 80; ++i) scaled.problem.sigma2[i] = 1 + i % 3;
  PnpRansac ransac(scaled.problem, {}, 1);
  const auto pose = run(ransac, 5);
  ASSERT_TRUE(pose);
  EXPECT_TRUE(pose->refined);
  std::size_t count = 0;
  for (int i = 0; i < 80; ++i) {
    const Eigen::Vector3d p_c = pose->T_cw * Eigen::Vector3d(scaled.problem.points.col(i));
    const double error =
        (scaled.problem.camera->pinhole().project(p_c) - scaled.problem.pixels.col(i))
            .squaredNorm();
    const bool inlier = p_c.z() > 0 && error < 5.991 * scaled.problem.sigma2[i];
    EXPECT_EQ(pose->inliers[static_cast<std::size_t>(i)] != 0, inlier);
    count += inlier ? 1 : 0;
  }
  EXPECT_EQ(pose->n_inliers, count);
  EXPECT_GT(count, ransac.min_inliers());
}

// OD-83: poses are not accepted by points behind the camera.
TEST(PnpRansac, PointsBehindTheCameraAreNoInliers) {
  auto synthetic = make_pnp_problem(PnpShape::general, 60, 0, 0, 4);
  // Mirrored through the camera centre a point keeps its pixel.
  const Eigen::Vector3d center = synthetic.T_cw.center();
  for (int i = 0; i < 20; ++i) {
    synthetic.problem.points.col(i) = 2 * center - synthetic.problem.points.col(i);
  }
  PnpRansac ransac(synthetic.problem, {}, 1);
  const auto pose = run(ransac, 5);
  ASSERT_TRUE(pose);
  EXPECT_TRUE(close_to_truth(*pose, synthetic));
  EXPECT_EQ(std::count(pose->inliers.begin(), pose->inliers.begin() + 20, 1), 0);
  EXPECT_EQ(pose->n_inliers, 40U);
}

TEST(PnpRansac, SlicesDoNotChangeTheResultNorDoRepetitions) {
  int found = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const auto synthetic = make_pnp_problem(PnpShape::general, 40, 1, 0.4, seed);
    PnpRansac whole(synthetic.problem, {}, seed), sliced(synthetic.problem, {}, seed),
        single(synthetic.problem, {}, seed);
    const auto a = whole.iterate(whole.max_iterations()), b = run(sliced, 5), c = run(single, 1);
    ASSERT_EQ(a.has_value(), b.has_value());
    ASSERT_EQ(a.has_value(), c.has_value());
    EXPECT_EQ(whole.iterations(), sliced.iterations());
    if (!a) continue;
    ++found;
    for (const auto& other : {b, c}) {
      const Eigen::Matrix4d T_a = a->T_cw.matrix(), T_b = other->T_cw.matrix();
      EXPECT_EQ(std::memcmp(T_a.data(), T_b.data(), sizeof(T_a)), 0);
      EXPECT_EQ(a->inliers, other->inliers);
      EXPECT_EQ(a->refined, other->refined);
    }
  }
  EXPECT_GT(found, 10);
}

// OD-82: the first turn of a candidate does not use up all its iterations.
TEST(PnpRansac, CallRunsAtMostTheIterationsAskedFor) {
  const auto synthetic = make_pnp_problem(PnpShape::general, 40, 0, 1.0, 1);  // nothing to find
  PnpRansac ransac(synthetic.problem, {}, 1);
  EXPECT_EQ(ransac.max_iterations(), 35);
  EXPECT_EQ(ransac.min_inliers(), 20U);
  EXPECT_FALSE(ransac.iterate(5));
  EXPECT_EQ(ransac.iterations(), 5);
  EXPECT_FALSE(ransac.exhausted());
  EXPECT_FALSE(ransac.iterate(1000));
  EXPECT_EQ(ransac.iterations(), 35);
  EXPECT_TRUE(ransac.exhausted());
  EXPECT_FALSE(ransac.iterate(5));
  EXPECT_EQ(ransac.iterations(), 35);
}

TEST(PnpRansac, TooFewCorrespondencesAreExhaustedAtOnce) {
  for (const int n : {0, 3, 9}) {
    PnpRansac ransac(make_pnp_problem(PnpShape::general, n, 0, 0, 1).problem, {}, 1);
    EXPECT_TRUE(ransac.exhausted());
    EXPECT_FALSE(ransac.iterate(5));
  }
  PnpRansac ten(make_pnp_problem(PnpShape::general, 10, 0, 0, 1).problem, {}, 1);
  EXPECT_EQ(ten.max_iterations(), 1);  // all ten must be inliers
}

TEST(PnpRansac, LastIterationGivesTheBestSampleWhenRefinementIsNotEnough) {
  // All correspondences are needed, and more than all cannot be had: never the refined pose.
  int found = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    PnpRansac ransac(make_pnp_problem(PnpShape::general, 10, 0, 0, seed).problem, {}, seed);
    const auto pose = ransac.iterate(5);
    EXPECT_TRUE(ransac.exhausted());
    if (!pose) continue;
    ++found;
    EXPECT_FALSE(pose->refined);
    EXPECT_EQ(pose->n_inliers, 10U);
  }
  EXPECT_GT(found, 8);
}

TEST(PnpRansac, PlanesGiveNumbers) {
  int right = 0;
  for (const PnpShape shape : {PnpShape::planar, PnpShape::slab}) {
    for (std::uint64_t seed = 0; seed < 50; ++seed) {
      const auto synthetic = make_pnp_problem(shape, 60, 0.5, 0.2, seed);
      PnpRansac ransac(synthetic.problem, {}, seed);
      const auto pose = run(ransac, 5);
      if (!pose) continue;
      EXPECT_TRUE(pose->T_cw.matrix().allFinite());
      right += testing::rotation_error_degrees(pose->T_cw, synthetic.T_cw) < 5 ? 1 : 0;
    }
  }
  EXPECT_GT(right, 60);
}

TEST(PnpRansac, RefusesBadArguments) {
  PnpProblem problem = make_pnp_problem(PnpShape::general, 20, 0, 0, 1).problem;
  PnpOptions options;
  options.ransac.probability = 1;
  EXPECT_THROW(PnpRansac(problem, options, 1), std::invalid_argument);
  problem.sigma2.conservativeResize(19);
  EXPECT_THROW(PnpRansac(problem, {}, 1), std::invalid_argument);
}

TEST(PnpRansac, AgreesWithTheReference) {
  PnpRansac ransac(testing::golden_pnp_problem(), {}, 0);
  const auto limits = testing::golden<int>("pnp", "out_maxits_mininliers");
  EXPECT_EQ(ransac.max_iterations(), limits.values[0]);
  EXPECT_EQ(static_cast<int>(ransac.min_inliers()), limits.values[1]);
  const auto pose = run(ransac, 5);
  ASSERT_TRUE(pose);
  const auto T = testing::golden<double>("pnp", "out_Tcw");
  EXPECT_EQ(static_cast<int>(pose->n_inliers),
            testing::golden<int>("pnp", "out_ninliers").values[0]);
  EXPECT_EQ(pose->inliers, testing::golden<std::uint8_t>("pnp", "out_inlier").values);
  // Our sample is another one, so the refinement may start from fewer inliers.
  for (std::size_t i = 0; i < 16; ++i) {
    EXPECT_NEAR(pose->T_cw.matrix()(static_cast<int>(i / 4), static_cast<int>(i % 4)), T.values[i],
                0.02);
  }
}

}  // namespace
}  // namespace orbslam
