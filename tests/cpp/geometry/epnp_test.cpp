// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/epnp.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "pnp_problems.hpp"

namespace orbslam {
namespace {

using testing::make_pnp_problem;
using testing::PnpShape;
using testing::SyntheticPnp;

double pose_error(const Pose& a, const Pose& b) { return (a.matrix() - b.matrix()).norm(); }

std::optional<EpnpPose> solve(const SyntheticPnp& s) {
  return solve_epnp(s.problem.points, s.problem.pixels, *s.problem.camera);
}

TEST(Epnp, ExactWithoutNoise) {
  for (const int n : {5, 6, 50}) {
    for (std::uint64_t seed = 0; seed < 300; ++seed) {
      const auto synthetic = make_pnp_problem(PnpShape::general, n, 0, 0, seed);
      const auto found = solve(synthetic);
      ASSERT_TRUE(found);
      EXPECT_LT(pose_error(found->T_cw, synthetic.T_cw), 1e-6) << n << " points, seed " << seed;
      EXPECT_LT(found->mean_error, 1e-6);
    }
  }
}

TEST(Epnp, FourPointsAreMostlyExactAndNeverWronglyFitting) {
  int exact = 0;
  for (std::uint64_t seed = 0; seed < 1000; ++seed) {
    const auto synthetic = make_pnp_problem(PnpShape::general, 4, 0, 0, seed);
    const auto found = solve(synthetic);
    ASSERT_TRUE(found);
    const bool right = pose_error(found->T_cw, synthetic.T_cw) < 1e-6;
    exact += right ? 1 : 0;
    if (found->mean_error < 1e-9) {
      EXPECT_TRUE(right) << seed;
    }
  }
  EXPECT_GE(exact, 680);  // measured 730
}

TEST(Epnp, PointsOnAPlane) {
  for (const int n : {4, 6, 50}) {
    int exact = 0;
    for (std::uint64_t seed = 0; seed < 300; ++seed) {
      const auto synthetic = make_pnp_problem(PnpShape::planar, n, 0, 0, seed);
      const auto found = solve(synthetic);
      ASSERT_TRUE(found);
      EXPECT_TRUE(found->T_cw.matrix().allFinite());
      exact += pose_error(found->T_cw, synthetic.T_cw) < 1e-4 ? 1 : 0;
    }
    EXPECT_GE(exact, 297) << n;
  }
}

TEST(Epnp, ThinSlabsAndNoisyPlanesGiveNumbers) {
  for (const PnpShape shape : {PnpShape::planar, PnpShape::slab}) {
    for (const int n : {4, 5, 12}) {
      for (std::uint64_t seed = 0; seed < 200; ++seed) {
        const auto found = solve(make_pnp_problem(shape, n, 1, 0, seed));
        if (found) {
          EXPECT_TRUE(found->T_cw.matrix().allFinite());
        }
      }
    }
  }
}

TEST(Epnp, NothingForCollinearEqualOrBrokenPoints) {
  const auto synthetic = make_pnp_problem(PnpShape::general, 6, 0, 0, 1);
  const auto solve_points = [&](const Eigen::Matrix3Xd& points) {
    return solve_epnp(points, synthetic.problem.pixels, *synthetic.problem.camera);
  };
  Eigen::Matrix3Xd points = synthetic.problem.points;
  for (int i = 0; i < 6; ++i)
    points.col(i) = Eigen::Vector3d(1, 2, 3) + i * Eigen::Vector3d(1, 1, 0);
  EXPECT_FALSE(solve_points(points));
  for (int i = 0; i < 6; ++i) points.col(i) = Eigen::Vector3d(1, 2, 3);
  EXPECT_FALSE(solve_points(points));
  points = synthetic.problem.points;
  points(1, 4) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(solve_points(points));
}

TEST(Epnp, RefusesTooFewPoints) {
  const auto synthetic = make_pnp_problem(PnpShape::general, 6, 0, 0, 1);
  EXPECT_THROW(solve_epnp(synthetic.problem.points.leftCols(3),
                          synthetic.problem.pixels.leftCols(3), *synthetic.problem.camera),
               std::invalid_argument);
  EXPECT_THROW(solve_epnp(synthetic.problem.points, synthetic.problem.pixels.leftCols(5),
                          *synthetic.problem.camera),
               std::invalid_argument);
}

/// 12 numbers R|t by rows, then the mean error.
double golden_difference(const EpnpPose& found, const testing::Array<double>& row, std::size_t at) {
  double difference = 0;
  for (std::size_t i = 0; i < 12; ++i) {
    const double value = found.T_cw.matrix()(static_cast<int>(i / 4), static_cast<int>(i % 4));
    difference = std::max(difference, std::abs(value - row.values[13 * at + i]));
  }
  return difference;
}

// The golden pixels are exact but for rounding to float32, 3e-5 pixels.
TEST(Epnp, AgreesWithTheReference) {
  const PnpProblem problem = testing::golden_pnp_problem();
  const auto all = solve_epnp(problem.points, problem.pixels, *problem.camera);
  ASSERT_TRUE(all);
  const auto expected_all = testing::golden<double>("pnp", "out_epnp_all");
  EXPECT_LT(golden_difference(*all, expected_all, 0), 1e-6);
  EXPECT_NEAR(all->mean_error, expected_all.values[12], 1e-5);

  const auto expected = testing::golden<double>("pnp", "out_epnp_sets");
  const auto sets = testing::golden<int>("pnp", "sets");
  for (std::size_t k = 0; k < sets.rows(); ++k) {
    Eigen::Matrix3Xd points(3, 6);
    Eigen::Matrix2Xd pixels(2, 6);
    for (std::size_t i = 0; i < 6; ++i) {
      points.col(static_cast<int>(i)) = problem.points.col(sets.at(k, i));
      pixels.col(static_cast<int>(i)) = problem.pixels.col(sets.at(k, i));
    }
    const auto found = solve_epnp(points, pixels, *problem.camera);
    ASSERT_TRUE(found);
    EXPECT_LT(golden_difference(*found, expected, k), 1e-6) << k;
    EXPECT_NEAR(found->mean_error, expected.at(k, 12), 1e-5) << k;
  }
}

TEST(Epnp, FourPointsAreSolvedAtLeastAsOftenAsByTheReference) {
  const PnpProblem problem = testing::golden_pnp_problem();
  const auto expected = testing::golden<double>("pnp4", "out_epnp_sets");
  const auto sets = testing::golden<int>("pnp4", "sets");
  const auto truth = testing::golden<double>("pnp", "Tcw_true");
  Eigen::Matrix4d T;
  for (std::size_t i = 0; i < 16; ++i) {
    T(static_cast<int>(i / 4), static_cast<int>(i % 4)) = truth.values[i];
  }
  int found_right = 0, reference_right = 0;
  for (std::size_t k = 0; k < sets.rows(); ++k) {
    double reference_error = 0;
    for (std::size_t i = 0; i < 12; ++i) {
      reference_error += std::abs(expected.at(k, i) - truth.values[i]);
    }
    Eigen::Matrix<double, 3, 4> points;
    Eigen::Matrix<double, 2, 4> pixels;
    for (std::size_t i = 0; i < 4; ++i) {
      points.col(static_cast<int>(i)) = problem.points.col(sets.at(k, i));
      pixels.col(static_cast<int>(i)) = problem.pixels.col(sets.at(k, i));
    }
    const auto found = solve_epnp(points, pixels, *problem.camera);
    ASSERT_TRUE(found);
    // Which samples are missed depends on the arbitrary basis of the kernel.
    found_right += (found->T_cw.matrix() - T).cwiseAbs().sum() < 1e-2 ? 1 : 0;
    reference_right += reference_error < 1e-2 ? 1 : 0;
  }
  EXPECT_GE(found_right, reference_right);
  EXPECT_GE(reference_right, 5);
}

}  // namespace
}  // namespace orbslam
