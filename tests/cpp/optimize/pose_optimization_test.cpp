// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/pose_optimization.hpp"

#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "golden.hpp"
#include "support/cameras.hpp"
#include "support/random_numbers.hpp"

namespace orbslam {
namespace {

using testing::golden_pose_problem;
using testing::PoseProblem;
using testing::uniform;

/// The same residuals written independently, for automatic differentiation.
struct OracleOfProjections {
  PoseObservation o;
  Pinhole k;
  double bf;
  Pose T_initial;

  template <class T>
  bool operator()(const T* xi, T* residual) const {
    // exp(xi) T_initial with the rotation vector in xi[0..2] and a plain translation in xi[3..5]:
    // another chart of the same poses, so the same minimum.
    const Eigen::Vector3d start = T_initial * o.position;
    const T p[3] = {T(start.x()), T(start.y()), T(start.z())};
    T c[3];
    ceres::AngleAxisRotatePoint(xi, p, c);
    for (int i = 0; i < 3; ++i) c[i] += xi[3 + i];
    const double scale = std::sqrt(o.inverse_sigma2);
    const T u = k.fx * c[0] / c[2] + k.cx;
    residual[0] = scale * (o.u - u);
    residual[1] = scale * (o.v - (k.fy * c[1] / c[2] + k.cy));
    residual[2] = o.has_depth ? scale * (o.right_u - (u - bf / c[2])) : T(0);
    return true;
  }
};

/// The rounds of optimize_pose() with Ceres instead of our own solver.
PoseEstimate solve_with_ceres(const PoseProblem& problem) {
  PoseEstimate estimate;
  estimate.outlier.assign(problem.observations.size(), 0);
  for (int round = 0; round < 4; ++round) {
    double xi[6] = {};
    ceres::Problem ceres_problem;
    for (std::size_t i = 0; i < problem.observations.size(); ++i) {
      if (estimate.outlier[i]) continue;
      const PoseObservation& o = problem.observations[i];
      const double gate = o.has_depth ? 7.815 : 5.991;
      ceres_problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<OracleOfProjections, 3, 6>(new OracleOfProjections{
              o, problem.camera->pinhole(), problem.camera->bf(), problem.T_cw_initial}),
          round < 3 ? new ceres::HuberLoss(std::sqrt(gate)) : nullptr, xi);
    }
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.max_num_iterations = 100;
    options.function_tolerance = options.parameter_tolerance = 1e-14;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &ceres_problem, &summary);

    const Eigen::Vector3d omega(xi[0], xi[1], xi[2]);
    Vector6d rotation = Vector6d::Zero();
    rotation.head<3>() = omega;
    estimate.T_cw = Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(xi[3], xi[4], xi[5])) *
                    Pose::exp(rotation) * problem.T_cw_initial;
    estimate.n_inliers = 0;
    for (std::size_t i = 0; i < problem.observations.size(); ++i) {
      double residual[3];
      OracleOfProjections{problem.observations[i], problem.camera->pinhole(), problem.camera->bf(),
                          problem.T_cw_initial}(xi, residual);
      const double squared =
          residual[0] * residual[0] + residual[1] * residual[1] + residual[2] * residual[2];
      const bool front = (estimate.T_cw * problem.observations[i].position).z() > 0;
      const double gate = problem.observations[i].has_depth ? 7.815 : 5.991;
      estimate.outlier[i] = front && squared <= gate ? 0 : 1;
      estimate.n_inliers += 1 - estimate.outlier[i];
    }
  }
  return estimate;
}

double distance(const Pose& a, const Pose& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff();
}

PoseProblem random_pose_problem(std::uint64_t seed, std::size_t n, double outliers,
                                bool with_depth) {
  std::mt19937_64 random(seed);
  PoseProblem problem;
  problem.camera = testing::make_camera({500, 510, 320, 240}, 40);
  Vector6d xi;
  for (int i = 0; i < 6; ++i) xi(i) = uniform(random, -1, 1);
  const Pose truth = Pose::exp(xi);
  for (int i = 0; i < 6; ++i) xi(i) = uniform(random, -0.03, 0.03);
  problem.T_cw_initial = Pose::exp(xi) * truth;
  for (std::size_t i = 0; i < n; ++i) {
    const double z = uniform(random, 1, 20);
    PoseObservation o;
    o.u = uniform(random, 0, 640);
    o.v = uniform(random, 0, 480);
    o.position = truth.inverse() * problem.camera->unproject(o.u, o.v, z);
    o.has_depth = with_depth && i % 3 != 0;
    o.right_u = o.u - problem.camera->bf() / z;
    if (uniform(random, 0, 1) < outliers) o.u += uniform(random, 10, 60);
    o.u += uniform(random, -1, 1);
    o.v += uniform(random, -1, 1);
    o.right_u += uniform(random, -1, 1);
    o.inverse_sigma2 = 1 / std::pow(1.44, static_cast<double>(i % 4));
    problem.observations.push_back(o);
  }
  return problem;
}

PoseEstimate solve(const PoseProblem& problem) {
  return optimize_pose(problem.T_cw_initial, *problem.camera, problem.observations);
}

class PoseOptimizationGolden : public ::testing::TestWithParam<const char*> {};

TEST_P(PoseOptimizationGolden, AgreesWithTheReference) {
  const PoseProblem problem = golden_pose_problem(GetParam());
  const PoseEstimate estimate = solve(problem);
  EXPECT_LT(distance(estimate.T_cw, problem.T_cw_expected), 1e-5);
  EXPECT_EQ(estimate.outlier, problem.outlier_expected);
  EXPECT_EQ(estimate.n_inliers,
            static_cast<int>(testing::golden<int>(GetParam(), "out_ninliers").values[0]));
}

TEST_P(PoseOptimizationGolden, AgreesWithCeres) {
  const PoseProblem problem = golden_pose_problem(GetParam());
  const PoseEstimate ours = solve(problem), oracle = solve_with_ceres(problem);
  EXPECT_LT(distance(ours.T_cw, oracle.T_cw), 1e-6);
  EXPECT_EQ(ours.outlier, oracle.outlier);
}

INSTANTIATE_TEST_SUITE_P(Sets, PoseOptimizationGolden,
                         ::testing::Values("poseopt_mono", "poseopt_stereo"));

TEST(PoseOptimization, AgreesWithCeresOnRandomProblems) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    // Odd numbers of both kinds exercise the padding.
    const PoseProblem problem = random_pose_problem(seed, 101 + seed, 0.15, seed % 2 == 0);
    const PoseEstimate ours = solve(problem), oracle = solve_with_ceres(problem);
    EXPECT_LT(distance(ours.T_cw, oracle.T_cw), 1e-6) << "seed " << seed;
    EXPECT_EQ(ours.outlier, oracle.outlier) << "seed " << seed;
  }
}

TEST(PoseOptimization, TooFewObservationsLeaveThePoseAlone) {
  PoseProblem problem = random_pose_problem(1, 2, 0, false);
  const PoseEstimate estimate = solve(problem);
  EXPECT_EQ(distance(estimate.T_cw, problem.T_cw_initial), 0);
  EXPECT_EQ(estimate.n_inliers, 0);
  EXPECT_EQ(estimate.covariance, Matrix6d::Zero());
  EXPECT_EQ(estimate.iterations, 0);
  problem.observations.clear();
  EXPECT_EQ(solve(problem).n_inliers, 0);
}

TEST(PoseOptimization, FewObservationsGetOneRound) {
  const PoseProblem problem = random_pose_problem(2, 9, 0, true);
  const PoseEstimate estimate = solve(problem);
  EXPECT_GE(estimate.n_inliers, 7);
  EXPECT_LE(estimate.iterations, 10);
}

// OD-110: points must lie in front of the camera.
TEST(PoseOptimization, PointsBehindTheCameraAreOutliers) {
  PoseProblem problem = random_pose_problem(3, 60, 0, true);
  const Pose T_wc = problem.T_cw_initial.inverse();
  for (std::size_t i = 0; i < 5; ++i) {
    PoseObservation o = problem.observations[i];
    const Eigen::Vector3d p_c = problem.T_cw_initial * o.position;
    o.position = T_wc * Eigen::Vector3d(-p_c);  // mirrored: the same pixel
    problem.observations.push_back(o);
  }
  const PoseEstimate estimate = solve(problem);
  for (std::size_t i = 60; i < 65; ++i) EXPECT_EQ(estimate.outlier[i], 1);
  EXPECT_GT(estimate.n_inliers, 50);
}

TEST(PoseOptimization, BrokenNumbersTakeNoPart) {
  PoseProblem problem = random_pose_problem(4, 50, 0, true);
  const PoseEstimate clean = solve(problem);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  PoseObservation o = problem.observations[0];
  o.position.x() = nan;
  problem.observations.push_back(o);
  o = problem.observations[1];
  o.u = std::numeric_limits<double>::infinity();
  problem.observations.push_back(o);
  o = problem.observations[2];
  o.position = problem.T_cw_initial.center();  // depth exactly zero
  problem.observations.push_back(o);
  const PoseEstimate estimate = solve(problem);
  EXPECT_TRUE(estimate.T_cw.matrix().allFinite());
  EXPECT_TRUE(estimate.covariance.allFinite());
  EXPECT_EQ(estimate.n_inliers, clean.n_inliers);
  for (std::size_t i = 50; i < 53; ++i) EXPECT_EQ(estimate.outlier[i], 1);
}

// OD-111: no further rounds with less than 3 inliers.
TEST(PoseOptimization, HopelessProblemEndsWithoutInliers) {
  PoseProblem problem = random_pose_problem(5, 30, 0, false);
  std::mt19937_64 random(9);
  for (PoseObservation& o : problem.observations) {
    o.u = uniform(random, 0, 640);
    o.v = uniform(random, 0, 480);
    o.inverse_sigma2 = 1e6;
  }
  const PoseEstimate estimate = solve(problem);
  EXPECT_LT(estimate.n_inliers, 3);
  EXPECT_LE(estimate.iterations, 10);
  EXPECT_TRUE(estimate.T_cw.matrix().allFinite());
}

TEST(PoseOptimization, RepeatsBitByBit) {
  const PoseProblem problem = random_pose_problem(6, 333, 0.2, true);
  const PoseEstimate a = solve(problem);
  solve(random_pose_problem(8, 700, 0.1, false));  // leaves other numbers in the workspace
  const PoseEstimate b = solve(problem);
  EXPECT_EQ(a.T_cw.matrix(), b.T_cw.matrix());
  EXPECT_EQ(a.covariance, b.covariance);
  EXPECT_EQ(a.outlier, b.outlier);
}

TEST(PoseOptimization, CovarianceIsThatOfRepeatedMeasurements) {
  // Same scene, fresh noise: the scatter of the estimates must be what one estimate predicts.
  const int n_runs = 300;
  Matrix6d scatter = Matrix6d::Zero(), predicted = Matrix6d::Zero();
  PoseProblem problem = random_pose_problem(10, 80, 0, true);
  const Pose truth = solve(problem).T_cw;
  std::mt19937_64 random(11);
  for (int run = 0; run < n_runs; ++run) {
    for (PoseObservation& o : problem.observations) {
      const Eigen::Vector3d p_c = truth * o.position;
      const Eigen::Vector2d pixel = problem.camera->pinhole().project(p_c);
      const double scale = 1 / std::sqrt(o.inverse_sigma2);
      o.u = pixel.x() + scale * uniform(random, -1, 1);
      o.v = pixel.y() + scale * uniform(random, -1, 1);
      o.right_u = pixel.x() - problem.camera->bf() / p_c.z() + scale * uniform(random, -1, 1);
    }
    const PoseEstimate estimate = solve(problem);
    const Vector6d error = (estimate.T_cw * truth.inverse()).log();
    scatter += error * error.transpose() / n_runs;
    predicted += estimate.covariance / n_runs;
  }
  for (int i = 0; i < 6; ++i) {
    EXPECT_NEAR(scatter(i, i) / predicted(i, i), 1, 0.3) << "component " << i;
  }
}

}  // namespace
}  // namespace orbslam
