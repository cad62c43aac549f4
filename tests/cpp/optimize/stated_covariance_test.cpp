// SPDX-License-Identifier: BSD-3-Clause
// The covariance of a pose, classical and cluster-robust, against errors of made-up frames.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

#include "frame/inlier_spread.hpp"
#include "optimize/pose_optimization.hpp"
#include "support/small_frame.hpp"

namespace orbslam {
namespace {

/// Poses that are estimated from points in 48 cells, `per_cell` in each, whose pixels have noise of
/// their own and noise that the points of a cell have in common.
class Trials {
 public:
  Trials(int per_cell, double own, double common)
      : per_cell_(per_cell), own_(own), common_(common) {}

  /// Mean normalised squared errors over many frames, by the cluster-robust and by the classical
  /// covariance. Both are 6 where the covariance is right.
  std::pair<double, double> mean_squared_errors(int n_frames) {
    double robust = 0, classical = 0;
    for (int i = 0; i < n_frames; ++i) {
      TrackedFrame frame = next();
      const PoseEstimate estimate = optimize_pose(frame);
      const Vector6d error = frame.T_cw->log();
      robust += error.dot(spread_of_inliers(frame).covariance.ldlt().solve(error));
      classical += error.dot(estimate.covariance.ldlt().solve(error));
    }
    return {robust / n_frames, classical / n_frames};
  }

 private:
  TrackedFrame next() {
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> place(0.5, 9.5), depth(1.0, 8.0);
    std::vector<std::pair<float, float>> pixels;
    std::vector<Eigen::Vector3d> points;
    for (int cell = 0; cell < 48; ++cell) {
      const double u0 = common_ * normal(random_), v0 = common_ * normal(random_);
      for (int k = 0; k < per_cell_; ++k) {
        const double u = 10 * (cell % 8) + place(random_), v = 10 * (cell / 8) + place(random_);
        const double z = depth(random_);
        points.emplace_back((u - 40) / 50 * z, (v - 30) / 50 * z, z);
        pixels.emplace_back(u + u0 + own_ * normal(random_), v + v0 + own_ * normal(random_));
      }
    }
    TrackedFrame frame = tracked_frame_at(pixels);
    frame.T_cw = Pose();
    for (std::size_t i = 0; i < points.size(); ++i) {
      frame.associate(i, MapPointId(static_cast<std::int64_t>(i)), points[i]);
    }
    return frame;
  }

  int per_cell_;
  double own_, common_;
  std::mt19937_64 random_{1};
};

TEST(StatedCovariance, IsThatOfIndependentResiduals) {
  const auto [robust, classical] = Trials(4, 0.5, 0).mean_squared_errors(300);
  // Six degrees of freedom: the mean of 300 lies within 6 +- 0.6 in all but one of 300 cases.
  EXPECT_NEAR(classical, 6, 0.6);
  EXPECT_NEAR(robust, 6, 1.2);
}

TEST(StatedCovariance, IsThatOfResidualsThatNeighboursHaveInCommon) {
  const auto [robust, classical] = Trials(6, 0.3, 0.5).mean_squared_errors(300);
  EXPECT_GT(classical, 15);
  EXPECT_NEAR(robust, 6, 2.5);
}

}  // namespace
}  // namespace orbslam
