// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/bundle_adjustment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "golden.hpp"

namespace orbslam {
namespace {

using testing::golden_bundle;
using testing::GoldenBundle;

double chi2_of(const BundleProblem& problem, const BundleProblem::Observation& o) {
  const auto& camera = problem.cameras[o.camera];
  const Eigen::Vector3d p = camera.T_cw * problem.points[o.point];
  const Eigen::Vector2d pixel = camera.pinhole.project(p);
  double squared = (Eigen::Vector2d(o.u, o.v) - pixel).squaredNorm();
  if (o.has_depth) squared += std::pow(o.right_u - (pixel.x() - camera.bf / p.z()), 2);
  return o.inverse_sigma2 * squared;
}

struct GoldenCase {
  const char* set;
  double cost;  ///< of the reference over the observations it keeps
};

void PrintTo(const GoldenCase& item, std::ostream* out) { *out << item.set; }

class BundleGolden : public ::testing::TestWithParam<GoldenCase> {};

TEST_P(BundleGolden, AgreesWithTheReference) {
  GoldenBundle golden = golden_bundle(GetParam().set);
  const BundleSummary summary = solve_bundle(golden.problem, BundleOptions(), nullptr);
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
  std::printf("%s: pose %.2e median point %.2e flags %zu cost %.3f iterations %d\n", GetParam().set,
              pose_error, point_errors[point_errors.size() / 2], n_different, cost,
              summary.iterations);
}

INSTANTIATE_TEST_SUITE_P(Sets, BundleGolden,
                         ::testing::Values(GoldenCase{"lba_mono", 3771.96},
                                           GoldenCase{"lba_stereo", 5434.80},
                                           GoldenCase{"lba_small", 88.397}));

}  // namespace
}  // namespace orbslam
