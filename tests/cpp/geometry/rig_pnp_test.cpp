// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "geometry/pnp_ransac.hpp"
#include "support/random_numbers.hpp"
#include "support/rigs.hpp"

namespace orbslam {
namespace {

using testing::uniform;

/// Points around a rig, of which some are matched with pixels anywhere.
PnpProblem rig_problem(const Pose& T_bw, double outlier_share, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  PnpProblem problem;
  problem.camera = testing::make_rig();
  problem.points.resize(3, 80);
  problem.pixels.resize(2, 80);
  problem.sigma2 = Eigen::VectorXd::Ones(80);
  for (int i = 0; i < 80;) {
    const double angle = uniform(random, -3.14, 3.14), distance = uniform(random, 2, 9);
    const Eigen::Vector3d p(distance * std::sin(angle), uniform(random, -1.5, 1.5),
                            distance * std::cos(angle));
    Eigen::Vector2d uv;
    if (!problem.camera->project(p, uv)) continue;
    problem.points.col(i) = T_bw.inverse() * p;
    problem.pixels.col(i) = uv;
    if (uniform(random, 0, 1) < outlier_share) problem.pixels.col(i).y() = uniform(random, 0, 480);
    ++i;
  }
  return problem;
}

TEST(PnpRansac, FindsTheBodyOfARig) {
  int n_found = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    Vector6d xi;
    std::mt19937_64 random(seed);
    for (int k = 0; k < 6; ++k) xi(k) = uniform(random, -1, 1);
    const Pose truth = Pose::exp(xi);
    PnpRansac ransac(rig_problem(truth, 0.3, seed), {}, seed);
    std::optional<PnpPose> pose;
    while (!pose && !ransac.exhausted()) pose = ransac.iterate(5);
    if (!pose || (pose->T_cw * truth.inverse()).log().norm() > 0.03) continue;
    ++n_found;
    EXPECT_GT(pose->n_inliers, 40U);
  }
  EXPECT_GE(n_found, 75);
}

TEST(PnpRansac, ARigWithFewPointsInEachCameraFindsNothing) {
  PnpProblem problem = rig_problem(Pose(), 0, 1);
  Eigen::Index taken[4] = {};
  Eigen::Index n = 0;
  for (Eigen::Index i = 0; i < problem.pixels.cols(); ++i) {
    auto& of_camera = taken[problem.camera->camera_at(problem.pixels(0, i))];
    if (of_camera++ >= 3) continue;
    problem.points.col(n) = problem.points.col(i);
    problem.pixels.col(n++) = problem.pixels.col(i);
  }
  problem.points.conservativeResize(3, n);
  problem.pixels.conservativeResize(2, n);
  problem.sigma2.conservativeResize(n);
  PnpRansac ransac(problem, {}, 1);
  EXPECT_TRUE(ransac.exhausted());
  EXPECT_FALSE(ransac.iterate(10));
}

}  // namespace
}  // namespace orbslam
