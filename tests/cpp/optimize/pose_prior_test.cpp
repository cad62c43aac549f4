// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "optimize/pose_optimization.hpp"
#include "support/cameras.hpp"
#include "support/random_numbers.hpp"

namespace orbslam {
namespace {

using testing::uniform;

struct Problem {
  std::shared_ptr<const Camera> camera = testing::make_camera({500, 510, 320, 240}, 40);
  Pose truth, start;
  std::vector<PoseObservation> observations;
};

Problem random_problem(std::uint64_t seed, std::size_t n) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise;
  Problem problem;
  Vector6d xi;
  for (int i = 0; i < 6; ++i) xi(i) = uniform(random, -1, 1);
  problem.truth = Pose::exp(xi);
  for (int i = 0; i < 6; ++i) xi(i) = uniform(random, -0.02, 0.02);
  problem.start = Pose::exp(xi) * problem.truth;
  for (std::size_t i = 0; i < n; ++i) {
    const double z = uniform(random, 1, 20);
    PoseObservation o;
    o.u = uniform(random, 0, 640);
    o.v = uniform(random, 0, 480);
    o.position = problem.truth.inverse() * problem.camera->unproject(o.u, o.v, z);
    o.has_depth = i % 3 != 0;
    o.right_u = o.u - problem.camera->bf() / z + 0.5 * noise(random);
    o.u += 0.5 * noise(random);
    o.v += 0.5 * noise(random);
    o.inverse_sigma2 = 1;
    problem.observations.push_back(o);
  }
  return problem;
}

double pose_distance(const Pose& a, const Pose& b) { return (a * b.inverse()).log().norm(); }

TEST(PosePrior, OneHalfOfTheObservationsAsPriorOfTheOtherGivesTheResultOfAll) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const Problem problem = random_problem(seed, 200);
    const auto& all = problem.observations;
    const std::vector<PoseObservation> first(all.begin(), all.begin() + 100);
    const std::vector<PoseObservation> second(all.begin() + 100, all.end());
    const PoseEstimate of_first = optimize_pose(problem.start, *problem.camera, first);
    ASSERT_EQ(of_first.n_inliers, 100);
    // The inverse of the normal matrix itself: the solver counts residuals with a variance of 1.
    PosePrior prior{of_first.T_cw, Matrix6d::Identity()};
    double variance = 0;
    int n = 0;
    for (const PoseObservation& o : first) {
      const Eigen::Vector3d p = of_first.T_cw * o.position;
      const double u = 500 * p.x() / p.z() + 320, v = 510 * p.y() / p.z() + 240;
      variance += (u - o.u) * (u - o.u) + (v - o.v) * (v - o.v);
      n += 2;
      if (!o.has_depth) continue;
      variance += std::pow(u - 40 / p.z() - o.right_u, 2);
      ++n;
    }
    variance /= n - 6;
    prior.information = of_first.covariance.inverse() * variance;
    const PoseEstimate together = optimize_pose(problem.start, *problem.camera, second, &prior);
    const PoseEstimate expected = optimize_pose(problem.start, *problem.camera, all);
    EXPECT_LT(pose_distance(together.T_cw, expected.T_cw),
              0.05 * pose_distance(of_first.T_cw, expected.T_cw))
        << "seed " << seed;
  }
}

TEST(PosePrior, PullsTowardsItsMeanByItsInformation) {
  const Problem problem = random_problem(3, 60);
  Vector6d off;
  off << 0.004, -0.003, 0.002, 0.03, 0.02, -0.01;
  const Pose mean = Pose::exp(off) * problem.truth;
  const PoseEstimate alone = optimize_pose(problem.start, *problem.camera, problem.observations);
  const PosePrior weak{mean, 1e-6 * Matrix6d::Identity()};
  const PosePrior certain{mean, 1e12 * Matrix6d::Identity()};
  const auto with = [&](const PosePrior& prior) {
    return optimize_pose(problem.start, *problem.camera, problem.observations, &prior);
  };
  EXPECT_LT(pose_distance(with(weak).T_cw, alone.T_cw), 1e-6);
  EXPECT_LT(pose_distance(with(certain).T_cw, mean), 1e-6);
  EXPECT_LT(with(certain).covariance.trace(), 7e-12);
}

TEST(PosePrior, TheCovarianceIsNeverAboveThatOfThePrior) {
  const Problem problem = random_problem(4, 30);
  const PosePrior prior{problem.truth, 1e4 * Matrix6d::Identity()};
  const PoseEstimate estimate =
      optimize_pose(problem.start, *problem.camera, problem.observations, &prior);
  const Matrix6d gain = 1e-4 * Matrix6d::Identity() - estimate.covariance;
  EXPECT_GT(gain.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), 0);
}

TEST(PosePrior, TheErrorsAreAsLargeAsTheCovarianceSays) {
  // Prior and images both drawn: the squared Mahalanobis distance has the mean 6.
  std::mt19937_64 random(7);
  std::normal_distribution<double> noise;
  Vector6d deviation;
  deviation << 2e-3, 2e-3, 2e-3, 0.02, 0.02, 0.02;
  const Matrix6d information = deviation.cwiseAbs2().cwiseInverse().asDiagonal();
  double sum = 0;
  constexpr int kDraws = 200;
  for (int draw = 0; draw < kDraws; ++draw) {
    Problem problem = random_problem(100 + static_cast<std::uint64_t>(draw), 12);
    for (PoseObservation& o : problem.observations) o.inverse_sigma2 = 4;  // of half a pixel
    Vector6d error;
    for (int i = 0; i < 6; ++i) error(i) = deviation(i) * noise(random);
    const PosePrior prior{Pose::exp(error) * problem.truth, information};
    const PoseEstimate estimate =
        optimize_pose(prior.mean, *problem.camera, problem.observations, &prior);
    const Vector6d off = (estimate.T_cw * problem.truth.inverse()).log();
    sum += off.dot(estimate.covariance.inverse() * off);
  }
  EXPECT_GT(sum / kDraws, 4.5);
  EXPECT_LT(sum / kDraws, 7.5);
}

TEST(PosePrior, FewObservationsLeaveTheMean) {
  Problem problem = random_problem(5, 2);
  const PosePrior prior{problem.truth, 1e4 * Matrix6d::Identity()};
  const PoseEstimate estimate =
      optimize_pose(problem.start, *problem.camera, problem.observations, &prior);
  EXPECT_LT(pose_distance(estimate.T_cw, problem.truth), 1e-15);
  EXPECT_EQ(estimate.n_inliers, 0);
  EXPECT_NEAR(estimate.covariance(0, 0), 1e-4, 1e-10);
  problem.observations.clear();
  EXPECT_LT(
      pose_distance(optimize_pose(problem.start, *problem.camera, {}, &prior).T_cw, problem.truth),
      1e-15);
}

}  // namespace
}  // namespace orbslam
