// SPDX-License-Identifier: BSD-3-Clause
// The solver by blocks against that of Ceres: same minimum, same inliers; and against itself.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "base/errors.hpp"
#include "golden.hpp"
#include "optimize/bundle_adjustment.hpp"
#include "optimize/bundle_kernels.hpp"
#include "optimize/bundle_minimiser.hpp"
#include "random_bundles.hpp"
#include "support/cameras.hpp"

namespace orbslam {
namespace {

using testing::golden_bundle;
using testing::numbers;
using testing::uniform;

/// A problem of some kind: sensor, size, noise, wrong matches, points that are seen once, hardly
/// from two places, or that lie behind a camera, cameras that are fixed or hardly see anything.
BundleProblem drawn_bundle(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto below = [&](double high) {
    return static_cast<std::size_t>(uniform(random, 0, high));
  };
  const std::size_t n_cameras = 2 + below(10), n_points = 30 + below(120);
  const double with_depth = seed % 3 == 0 ? 0 : seed % 3 == 1 ? 1 : 0.5;
  const double step = seed % 7 == 0 ? 0.02 : 0.3;  // nearly no parallax
  const double wrong = seed % 5 == 0 ? 0 : 0.05, seen = uniform(random, 0.3, 1);
  BundleProblem problem;
  std::vector<Pose> truth;
  for (std::size_t i = 0; i < n_cameras; ++i) {
    const Pose T_cw(Eigen::Quaterniond::Identity(),
                    Eigen::Vector3d(-step * static_cast<double>(i), 0, 0));
    truth.push_back(T_cw);
    Vector6d xi;
    for (int k = 0; k < 6; ++k) xi(k) = uniform(random, -0.01, 0.01);
    const bool fixed = i < 2 || uniform(random, 0, 1) < 0.3;
    const double f = i % 2 == 0 ? 500 : 450;
    problem.cameras.push_back(
        {fixed ? T_cw : Pose::exp(xi) * T_cw, testing::make_camera({f, 500, 320, 240}, 40), fixed});
  }
  for (std::size_t i = 0; i < n_points; ++i) {
    const Eigen::Vector3d point(uniform(random, -1, 3), uniform(random, -2, 2),
                                uniform(random, 3, i % 10 == 0 ? 60 : 9));
    const double share = i % 17 == 0 ? 0 : seen;
    const std::size_t surely = below(static_cast<double>(n_cameras));
    for (std::size_t c = 0; c < n_cameras; ++c) {
      if (c != surely && !(uniform(random, 0, 1) < share)) continue;
      const Eigen::Vector3d p_c = truth[c] * point;
      const Eigen::Vector2d pixel = problem.cameras[c].model->pinhole().project(p_c);
      BundleProblem::Observation o;
      o.camera = static_cast<std::uint32_t>(c);
      o.point = static_cast<std::uint32_t>(i);
      o.has_depth = uniform(random, 0, 1) < with_depth;
      const double off = uniform(random, 0, 1) < wrong ? uniform(random, 20, 60) : 0;
      o.u = static_cast<float>(pixel.x() + off + uniform(random, -0.7, 0.7));
      o.v = static_cast<float>(pixel.y() + uniform(random, -0.7, 0.7));
      const double base = problem.cameras[c].model->bf() / p_c.z();
      o.right_u = static_cast<float>(pixel.x() - base + uniform(random, -0.7, 0.7));
      o.inverse_sigma2 = i % 3 == 0 ? 0.4823F : 1.0F;
      o.right_factor = i % 4 == 0 ? 2.5F : i % 4 == 1 ? 0.2F : 1.0F;
      problem.observations.push_back(o);
    }
    Eigen::Vector3d shift;
    for (double& value : shift) value = uniform(random, -0.05, 0.05);
    problem.points.push_back(i % 41 == 40 ? Eigen::Vector3d(point.x(), point.y(), -2)
                                          : Eigen::Vector3d(point + shift));
  }
  return problem;
}

BundleSummary solve(BundleProblem& problem, BundleSolver solver, int n_threads = 1) {
  BundleOptions options;
  options.solver = solver;
  options.n_threads = n_threads;
  return solve_bundle(problem, options, nullptr);
}

struct Comparison {
  double cost_ratio = 1;
  std::size_t n_different = 0;  ///< observations that only one calls an outlier
};

Comparison compare(const BundleProblem& start) {
  BundleProblem by_blocks = start, by_ceres = start;
  const BundleSummary blocks = solve(by_blocks, BundleSolver::kBlocks);
  const BundleSummary ceres = solve(by_ceres, BundleSolver::kCeres);
  Comparison result;
  result.cost_ratio = blocks.final_cost / ceres.final_cost;
  for (std::size_t i = 0; i < blocks.outlier.size(); ++i) {
    result.n_different += blocks.outlier[i] != ceres.outlier[i] ? 1 : 0;
  }
  return result;
}

TEST(BundleSolvers, AgreeOnTheGoldenProblems) {
  for (const char* set : {"lba_mono", "lba_stereo", "lba_small"}) {
    const Comparison found = compare(golden_bundle(set).problem);
    EXPECT_NEAR(found.cost_ratio, 1, 1e-6) << set;
    EXPECT_EQ(found.n_different, 0U) << set;
  }
}

TEST(BundleSolvers, AgreeOnAThousandDrawnProblems) {
  std::size_t n_other_inliers = 0;
  for (std::uint64_t seed = 0; seed < 1000; ++seed) {
    const BundleProblem problem = drawn_bundle(seed);
    const Comparison found = compare(problem);
    // Where weakly determined depths wander, one of them may get a little further.
    EXPECT_LE(found.cost_ratio, 1.001) << seed;
    EXPECT_GE(found.cost_ratio, 0.99) << seed;
    EXPECT_LE(found.n_different, problem.observations.size() / 100) << seed;
    n_other_inliers += found.n_different > 0 ? 1 : 0;
  }
  EXPECT_LE(n_other_inliers, 10U);
}

TEST(BundleSolvers, BytesDoNotDependOnThreads) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    BundleProblem alone = drawn_bundle(seed), together = alone;
    const BundleSummary one = solve(alone, BundleSolver::kBlocks, 1);
    const BundleSummary two = solve(together, BundleSolver::kBlocks, 2);
    EXPECT_EQ(numbers(alone), numbers(together));
    EXPECT_EQ(one.final_cost, two.final_cost);
    EXPECT_EQ(one.outlier, two.outlier);
  }
}

/// The first stage with given kernels.
std::vector<double> minimised(BundleProblem problem, const bundle_kernels::Kernels& kernels) {
  const std::vector<std::uint8_t> usable(problem.observations.size(), 1);
  BundleSummary summary;
  block_minimiser(problem, BundleOptions(), usable, kernels)->minimise({5}, summary);
  EXPECT_GT(summary.iterations, 0);
  return numbers(problem);
}

TEST(BundleSolvers, BytesDoNotDependOnTheProcessor) {
  const bundle_kernels::Kernels& portable = bundle_kernels::portable_kernels();
  const bundle_kernels::Kernels* avx2 = bundle_kernels::avx2_kernels();
#if defined(__x86_64__)
  ASSERT_NE(avx2, nullptr);
  if (!__builtin_cpu_supports("avx2")) GTEST_SKIP() << "this processor has no AVX2";
#endif
  if (avx2 == nullptr) GTEST_SKIP() << "this kind of processor has the portable kernels alone";
  for (const std::uint64_t seed : {3U, 4U, 5U}) {
    EXPECT_EQ(minimised(drawn_bundle(seed), portable), minimised(drawn_bundle(seed), *avx2));
  }
  const BundleProblem golden = golden_bundle("lba_stereo").problem;
  EXPECT_EQ(minimised(golden, portable), minimised(golden, *avx2));
}

TEST(BundleSolvers, OrderOfObservationsDoesNotMatter) {
  BundleProblem problem = drawn_bundle(8), reversed = problem;
  std::reverse(reversed.observations.begin(), reversed.observations.end());
  const BundleSummary forward = solve(problem, BundleSolver::kBlocks);
  const BundleSummary backward = solve(reversed, BundleSolver::kBlocks);
  EXPECT_NEAR(backward.final_cost, forward.final_cost, 1e-6 * forward.final_cost);
  EXPECT_EQ(backward.outlier,
            std::vector<std::uint8_t>(forward.outlier.rbegin(), forward.outlier.rend()));
}

TEST(BundleSolvers, APointMayBeSeenTwiceByOneCamera) {
  BundleProblem problem = testing::random_bundle(21, 5, 60, 2, false);
  const std::size_t n = problem.observations.size();
  for (std::size_t i = 0; i < n; i += 3) {
    problem.observations.push_back(problem.observations[i]);
    problem.observations.back().u += 0.5F;
  }
  const Comparison found = compare(problem);
  EXPECT_NEAR(found.cost_ratio, 1, 1e-6);
  EXPECT_EQ(found.n_different, 0U);
}

TEST(BundleSolvers, InverseDepthsAreForCeres) {
  BundleProblem problem = drawn_bundle(1);
  BundleOptions options;
  options.solver = BundleSolver::kBlocks;
  options.inverse_depth = true;
  EXPECT_THROW(solve_bundle(problem, options, nullptr), StateError);
}

}  // namespace
}  // namespace orbslam
