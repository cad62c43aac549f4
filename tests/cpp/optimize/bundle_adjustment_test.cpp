// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/bundle_adjustment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <thread>

#include "base/errors.hpp"
#include "golden.hpp"
#include "random_bundles.hpp"

namespace orbslam {
namespace {

using testing::all_finite;
using testing::golden_bundle;
using testing::GoldenBundle;
using testing::numbers;
using testing::random_bundle;

double chi2_of(const BundleProblem& problem, const BundleProblem::Observation& o) {
  const auto& camera = problem.cameras[o.camera];
  const Eigen::Vector3d p = camera.T_cw * problem.points[o.point];
  const Eigen::Vector2d pixel = camera.model->pinhole().project(p);
  double squared = (Eigen::Vector2d(o.u, o.v) - pixel).squaredNorm();
  if (o.has_depth) squared += std::pow(o.right_u - (pixel.x() - camera.model->bf() / p.z()), 2);
  return o.inverse_sigma2 * squared;
}

struct GoldenCase {
  const char* set;
  double cost;  ///< of the reference over the observations it keeps
  BundleSolver solver;
};

void PrintTo(const GoldenCase& item, std::ostream* out) {
  *out << item.set << (item.solver == BundleSolver::kCeres ? " with Ceres" : " by blocks");
}

class BundleGolden : public ::testing::TestWithParam<GoldenCase> {};

TEST_P(BundleGolden, AgreesWithTheReference) {
  GoldenBundle golden = golden_bundle(GetParam().set);
  BundleOptions options;
  options.solver = GetParam().solver;
  const BundleSummary summary = solve_bundle(golden.problem, options, nullptr);
  EXPECT_TRUE(summary.stage_one_done);
  EXPECT_FALSE(summary.aborted);
  EXPECT_LT(summary.final_cost, summary.initial_cost);

  double pose_error = 0;
  for (std::size_t i = 0; i < golden.problem.cameras.size(); ++i) {
    const Eigen::Matrix4d difference =
        golden.problem.cameras[i].T_cw.matrix() - golden.T_cw_expected[i].matrix();
    pose_error = std::max(pose_error, difference.cwiseAbs().maxCoeff());
  }
  EXPECT_LT(pose_error, 5e-5);

  std::vector<double> point_errors;
  for (std::size_t i = 0; i < golden.problem.points.size(); ++i) {
    point_errors.push_back((golden.problem.points[i] - golden.points_expected[i]).norm());
  }
  std::nth_element(point_errors.begin(), point_errors.begin() + point_errors.size() / 2,
                   point_errors.end());
  EXPECT_LT(point_errors[point_errors.size() / 2], 1e-3);

  std::size_t n_different = 0;
  double cost = 0;
  for (std::size_t i = 0; i < golden.problem.observations.size(); ++i) {
    n_different += summary.outlier[i] != golden.erased_expected[i] ? 1 : 0;
    if (!golden.erased_expected[i]) cost += chi2_of(golden.problem, golden.problem.observations[i]);
  }
  EXPECT_LE(n_different, golden.problem.observations.size() / 1000);
  EXPECT_LE(cost, 1.001 * GetParam().cost);
}

INSTANTIATE_TEST_SUITE_P(Sets, BundleGolden,
                         ::testing::Values(GoldenCase{"lba_mono", 3771.96, BundleSolver::kBlocks},
                                           GoldenCase{"lba_stereo", 5434.80, BundleSolver::kBlocks},
                                           GoldenCase{"lba_small", 88.397, BundleSolver::kBlocks},
                                           GoldenCase{"lba_mono", 3771.96, BundleSolver::kCeres},
                                           GoldenCase{"lba_stereo", 5434.80, BundleSolver::kCeres},
                                           GoldenCase{"lba_small", 88.397, BundleSolver::kCeres}));

class SolveBundle : public ::testing::TestWithParam<BundleSolver> {
 protected:
  static BundleOptions options() {
    BundleOptions options;
    options.solver = GetParam();
    return options;
  }
};

std::string name_of(const ::testing::TestParamInfo<BundleSolver>& info) {
  return info.param == BundleSolver::kCeres ? "Ceres" : "Blocks";
}

INSTANTIATE_TEST_SUITE_P(Solvers, SolveBundle,
                         ::testing::Values(BundleSolver::kBlocks, BundleSolver::kCeres), name_of);

TEST_P(SolveBundle, RepeatsBitByBit) {
  for (const bool with_depth : {false, true}) {
    BundleProblem a = random_bundle(1, 8, 150, 2, with_depth), b = a;
    const BundleSummary first = solve_bundle(a, options(), nullptr);
    const BundleSummary second = solve_bundle(b, options(), nullptr);
    EXPECT_EQ(numbers(a), numbers(b));
    EXPECT_EQ(first.outlier, second.outlier);
    EXPECT_EQ(first.final_cost, second.final_cost);
  }
}

TEST_P(SolveBundle, FixedCamerasStay) {
  BundleProblem problem = random_bundle(2, 6, 80, 3, true);
  const BundleProblem start = problem;
  const BundleSummary summary = solve_bundle(problem, options(), nullptr);
  EXPECT_LT(summary.final_cost, 0.1 * summary.initial_cost);
  for (std::size_t i = 0; i < 6; ++i) {
    const bool same = problem.cameras[i].T_cw.matrix() == start.cameras[i].T_cw.matrix();
    EXPECT_EQ(same, i < 3) << "camera " << i;
  }
}

TEST_P(SolveBundle, ManyCameras) {
  BundleProblem problem = random_bundle(3, 36, 100, 2, true);
  const BundleSummary summary = solve_bundle(problem, options(), nullptr);
  EXPECT_LT(summary.final_cost, 0.1 * summary.initial_cost);
}

TEST(InverseDepths, FindTheSameMinimum) {
  for (const bool with_depth : {false, true}) {
    BundleProblem by_coordinates = random_bundle(11, 8, 150, 2, with_depth);
    by_coordinates.points.push_back({1, 2, 3});  // nobody sees it
    BundleProblem by_inverse_depth = by_coordinates;
    BundleOptions options;
    options.solver = BundleSolver::kCeres;
    options.robust_iterations = 30;
    options.final_iterations = 0;
    const BundleSummary expected = solve_bundle(by_coordinates, options, nullptr);
    options.inverse_depth = true;
    const BundleSummary summary = solve_bundle(by_inverse_depth, options, nullptr);
    EXPECT_NEAR(summary.final_cost, expected.final_cost, 1e-4 * expected.final_cost);
    EXPECT_LE(summary.iterations, expected.iterations);
    EXPECT_EQ(by_inverse_depth.points.back(), Eigen::Vector3d(1, 2, 3));
    for (std::size_t i = 0; i < by_coordinates.points.size(); ++i) {
      EXPECT_LT((by_coordinates.points[i] - by_inverse_depth.points[i]).norm(), 0.02);
    }
  }
}

TEST(InverseDepths, BearPointsThatLieNowhere) {
  // Seen twice from nearly the same place, with a disparity of the wrong sign: beyond infinity.
  BundleProblem problem = random_bundle(12, 6, 100, 2, false);
  for (int k = 0; k < 5; ++k) {
    const auto point = static_cast<std::uint32_t>(problem.points.size());
    problem.points.emplace_back(0.2 * k, 0, 50);
    for (const std::uint32_t camera : {1U, 2U}) {
      BundleProblem::Observation o;
      o.camera = camera;
      o.point = point;
      const auto pixel = problem.cameras[camera].model->pinhole().project(
          problem.cameras[camera].T_cw * problem.points[point]);
      o.u = static_cast<float>(pixel.x()) + (camera == 1U ? -6.0F : 6.0F);
      o.v = static_cast<float>(pixel.y());
      problem.observations.push_back(o);
    }
  }
  BundleOptions options;
  options.solver = BundleSolver::kCeres;
  options.robust_iterations = 20;
  options.final_iterations = 0;
  options.inverse_depth = true;
  const BundleSummary summary = solve_bundle(problem, options, nullptr);
  EXPECT_LT(summary.final_cost, 0.1 * summary.initial_cost);
  EXPECT_TRUE(all_finite(problem));
  for (std::size_t i = 100; i < problem.points.size(); ++i) {
    EXPECT_GT(problem.points[i].z(), 50);
    EXPECT_LT(problem.points[i].norm(), 1e4);
  }
}

TEST_P(SolveBundle, SinglePoseFixedOrFree) {
  BundleProblem one_fixed = random_bundle(4, 4, 60, 1, true);
  BundleSummary summary = solve_bundle(one_fixed, options(), nullptr);
  EXPECT_LT(summary.final_cost, summary.initial_cost);
  EXPECT_TRUE(all_finite(one_fixed));

  BundleProblem none_fixed = random_bundle(5, 4, 60, 0, false);  // free gauge and scale
  summary = solve_bundle(none_fixed, options(), nullptr);
  EXPECT_LT(summary.final_cost, summary.initial_cost);
  EXPECT_TRUE(all_finite(none_fixed));

  BundleProblem only_points = random_bundle(6, 3, 60, 3, false);
  summary = solve_bundle(only_points, options(), nullptr);
  EXPECT_LT(summary.final_cost, summary.initial_cost);

  BundleProblem alone = random_bundle(7, 1, 60, 0, false);  // depths undetermined
  summary = solve_bundle(alone, options(), nullptr);
  EXPECT_LE(summary.final_cost, summary.initial_cost);
  EXPECT_TRUE(all_finite(alone));
}

TEST_P(SolveBundle, NothingToDo) {
  BundleProblem empty;
  EXPECT_EQ(solve_bundle(empty, options(), nullptr).iterations, 0);
  BundleProblem problem = random_bundle(8, 3, 5, 1, false);
  problem.observations.clear();
  const std::vector<double> start = numbers(problem);
  const BundleSummary summary = solve_bundle(problem, options(), nullptr);
  EXPECT_EQ(summary.iterations, 0);
  EXPECT_TRUE(summary.stage_one_done);
  EXPECT_EQ(numbers(problem), start);
}

TEST_P(SolveBundle, UnknownCameraOrPointIsAnError) {
  BundleProblem problem = random_bundle(9, 2, 5, 1, false);
  problem.observations[3].camera = 2;
  EXPECT_THROW(solve_bundle(problem, options(), nullptr), StateError);
  problem.observations[3].camera = 0;
  problem.observations[3].point = 5;
  EXPECT_THROW(solve_bundle(problem, options(), nullptr), StateError);
}

TEST_P(SolveBundle, OutliersAreFoundAndDoNotPull) {
  BundleProblem problem = random_bundle(10, 6, 100, 2, true);
  std::vector<std::uint8_t> wrong(problem.observations.size(), 0);
  for (std::size_t i = 0; i < wrong.size(); i += 23) {
    problem.observations[i].u += 30;
    wrong[i] = 1;
  }
  const BundleSummary summary = solve_bundle(problem, options(), nullptr);
  for (std::size_t i = 0; i < wrong.size(); ++i) EXPECT_EQ(summary.outlier[i], wrong[i]) << i;
  for (std::size_t c = 2; c < 6; ++c) {
    const Eigen::Vector3d center = problem.cameras[c].T_cw.center();
    EXPECT_LT((center - Eigen::Vector3d(0.3 * static_cast<double>(c), 0, 0)).norm(), 0.01);
  }
}

TEST_P(SolveBundle, BrokenNumbersAndPointsBehindTheCamera) {
  BundleProblem problem = random_bundle(11, 5, 60, 2, true);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  problem.points[3].y() = nan;
  problem.points[7].z() = -4;
  problem.points[9] = problem.cameras[0].T_cw.center();  // depth zero
  problem.observations[100].u = static_cast<float>(nan);
  const BundleSummary summary = solve_bundle(problem, options(), nullptr);
  EXPECT_TRUE(std::isfinite(summary.final_cost));
  EXPECT_LT(summary.final_cost, summary.initial_cost);
  EXPECT_EQ(summary.outlier[100], 1);
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    const auto& o = problem.observations[i];
    if (o.point == 3 || o.point == 7) {
      EXPECT_EQ(summary.outlier[i], 1);
    }
  }
  for (const auto& camera : problem.cameras) EXPECT_TRUE(camera.T_cw.matrix().allFinite());
  problem.points[3].setZero();
  EXPECT_TRUE(all_finite(problem));
}

// OD-109: observations are judged anew at the final estimate.
TEST_P(SolveBundle, PointThatComesToTheFrontTakesPartInTheSecondStage) {
  BundleProblem problem = random_bundle(14, 6, 60, 2, false);
  // A fixed camera further ahead sees a point 0.5 m away, which starts 0.2 m behind it.
  problem.cameras.push_back({Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, -2.5)),
                             problem.cameras[0].model, true});
  const Eigen::Vector3d truth(0.1, 0.05, 3.0);
  problem.points.emplace_back(0.1, 0.05, 2.3);
  for (std::uint32_t c : {0u, 1u, 2u, 3u, 4u, 5u, 6u}) {
    const Pose T_cw = c == 6
                          ? problem.cameras[6].T_cw
                          : Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-0.3 * c, 0, 0));
    const Eigen::Vector2d pixel = problem.cameras[c].model->pinhole().project(T_cw * truth);
    BundleProblem::Observation o;
    o.camera = c;
    o.point = 60;
    o.u = static_cast<float>(pixel.x());
    o.v = static_cast<float>(pixel.y());
    problem.observations.push_back(o);
  }
  const BundleSummary summary = solve_bundle(problem, options(), nullptr);
  EXPECT_EQ(summary.outlier.back(), 0);
  EXPECT_LT((problem.points[60] - truth).norm(), 0.01);
}

TEST_P(SolveBundle, RaisedFlagStopsBeforeAnything) {
  BundleProblem problem = random_bundle(12, 5, 60, 2, true);
  const std::vector<double> start = numbers(problem);
  const std::atomic<bool> abort{true};
  const BundleSummary summary = solve_bundle(problem, options(), &abort);
  EXPECT_TRUE(summary.aborted);
  EXPECT_FALSE(summary.stage_one_done);
  EXPECT_EQ(summary.iterations, 0);
  EXPECT_EQ(summary.final_cost, summary.initial_cost);
  EXPECT_EQ(numbers(problem), start);
}

TEST_P(SolveBundle, FlagRaisedDuringTheWorkKeepsTheProgress) {
  // Wherever the other thread's flag hits, the result is some prefix of the iterations: never
  // worse than the start, with flags that belong to it.
  const BundleProblem start = random_bundle(13, 20, 600, 2, true);
  for (int delay = 0; delay < 12; ++delay) {
    BundleProblem problem = start;
    std::atomic<bool> abort{false};
    std::thread other([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(2 * delay));
      abort = true;
    });
    const BundleSummary summary = solve_bundle(problem, options(), &abort);
    other.join();
    EXPECT_LE(summary.final_cost, summary.initial_cost);
    EXPECT_TRUE(all_finite(problem));
    if (summary.iterations == 0) {
      EXPECT_EQ(numbers(problem), numbers(start));
    }
    for (std::size_t i = 0; i < problem.observations.size(); ++i) {
      const auto& o = problem.observations[i];
      EXPECT_EQ(summary.outlier[i], chi2_of(problem, o) > (o.has_depth ? 7.815 : 5.991) ? 1 : 0);
    }
  }
}

}  // namespace
}  // namespace orbslam
