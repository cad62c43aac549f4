// SPDX-License-Identifier: BSD-3-Clause
// Poses and bundles of several cameras that are mounted rigidly.
#include <gtest/gtest.h>

#include <random>

#include "optimize/bundle_adjustment.hpp"
#include "optimize/pose_optimization.hpp"
#include "optimize/sim3_residuals.hpp"
#include "support/random_numbers.hpp"
#include "support/rigs.hpp"

namespace orbslam {
namespace {

using testing::make_rig;
using testing::uniform;

std::vector<Eigen::Vector3d> points_around(std::mt19937_64& random, int n) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < n; ++i) {
    const double angle = uniform(random, -3.14, 3.14), distance = uniform(random, 2, 9);
    points.emplace_back(distance * std::sin(angle), uniform(random, -1, 1),
                        distance * std::cos(angle));
  }
  return points;
}

Pose random_pose(std::mt19937_64& random, double size) {
  Vector6d xi;
  for (int k = 0; k < 6; ++k) xi(k) = uniform(random, -size, size);
  return Pose::exp(xi);
}

double pose_difference(const Pose& a, const Pose& b) { return (a * b.inverse()).log().norm(); }

struct SeenPixel {
  float u, v, right_u;
  bool has_depth;
};

std::optional<SeenPixel> look(const Camera& rig, const Pose& T_bw, const Eigen::Vector3d& point,
                              bool has_depth) {
  Eigen::Vector2d uv;
  double disparity = 0;
  if (!rig.project(T_bw * point, uv, disparity)) return std::nullopt;
  const Eigen::Vector2f pixel = uv.cast<float>();
  return SeenPixel{pixel.x(), pixel.y(), pixel.x() - static_cast<float>(disparity), has_depth};
}

TEST(Rig, PoseOfAFrameComesFromAllCameras) {
  std::mt19937_64 random(1);
  const auto rig = make_rig();
  const Pose truth = random_pose(random, 0.5);
  std::vector<PoseObservation> observations;
  std::vector<std::size_t> cameras(4);
  for (const Eigen::Vector3d& p : points_around(random, 300)) {
    const Eigen::Vector3d point = truth.inverse() * p;
    const auto seen = look(*rig, truth, point, observations.size() % 2 == 0);
    if (!seen) continue;
    PoseObservation o;
    o.position = point;
    o.u = seen->u;
    o.v = seen->v;
    o.right_u = seen->right_u;
    o.has_depth = seen->has_depth;
    if (observations.size() % 10 == 3) o.v += 25;  // a wrong match
    ++cameras[rig->camera_at(seen->u)];
    observations.push_back(o);
  }
  for (const std::size_t n : cameras) EXPECT_GT(n, 20U);
  const PoseEstimate estimate =
      optimize_pose(random_pose(random, 0.03) * truth, *rig, observations);
  EXPECT_LT(pose_difference(estimate.T_cw, truth), 1e-4);
  for (std::size_t i = 0; i < observations.size(); ++i) {
    EXPECT_EQ(estimate.outlier[i] != 0, i % 10 == 3) << i;
  }
}

BundleProblem bundle_of(std::uint64_t seed, std::vector<Pose>& truth) {
  std::mt19937_64 random(seed);
  const auto rig = make_rig();
  BundleProblem problem;
  for (int i = 0; i < 5; ++i) {
    truth.push_back(i == 0 ? Pose() : random_pose(random, 0.4));
    const Pose start = i == 0 ? truth.back() : random_pose(random, 0.01) * truth.back();
    problem.cameras.push_back({start, rig, i == 0});
  }
  for (const Eigen::Vector3d& point : points_around(random, 150)) {
    const auto index = static_cast<std::uint32_t>(problem.points.size());
    for (std::uint32_t c = 0; c < truth.size(); ++c) {
      const auto seen = look(*rig, truth[c], point, (index + c) % 3 == 0);
      if (!seen) continue;
      BundleProblem::Observation o;
      o.camera = c;
      o.point = index;
      o.u = seen->u;
      o.v = seen->v;
      o.right_u = seen->right_u;
      o.has_depth = seen->has_depth;
      problem.observations.push_back(o);
    }
    problem.points.emplace_back(1.01 * point);
  }
  return problem;
}

TEST(Rig, BothSolversFindPosesAndPoints) {
  for (const BundleSolver solver : {BundleSolver::kBlocks, BundleSolver::kCeres}) {
    std::vector<Pose> truth;
    BundleProblem problem = bundle_of(4, truth);
    BundleOptions options;
    options.solver = solver;
    options.robust_iterations = 10;
    const BundleSummary summary = solve_bundle(problem, options, nullptr);
    EXPECT_GT(summary.initial_cost, 1e3);
    EXPECT_LT(summary.final_cost, 1);
    for (std::size_t i = 0; i < truth.size(); ++i) {
      EXPECT_LT(pose_difference(problem.cameras[i].T_cw, truth[i]), 1e-3) << i;
    }
  }
}

TEST(Rig, ResidualsOfSimilaritiesHaveTheDerivativeOfTheirErrors) {
  std::mt19937_64 random(7);
  const auto rig = make_rig();
  int n = 0;
  for (const Eigen::Vector3d& p : points_around(random, 60)) {
    SimilarityMatch match;
    match.point_2 = p;
    Eigen::Vector2d uv;
    if (!rig->project(p, uv)) continue;
    match.pixel_1 = uv + Eigen::Vector2d(0.5, -0.3);
    const auto at = sim3_residuals::forward(Similarity(), *rig, match);
    ASSERT_TRUE(at);
    Eigen::Matrix<double, 7, 1> step;
    for (int k = 0; k < 7; ++k) step(k) = uniform(random, -1e-6, 1e-6);
    const auto moved = sim3_residuals::forward(Similarity::exp(step), *rig, match);
    EXPECT_LT((moved->error - at->error - at->jacobian * step).norm(), 1e-3 * step.norm() + 1e-7);
    ++n;
  }
  EXPECT_GT(n, 30);
}

}  // namespace
}  // namespace orbslam
