// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/fundamental.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/SVD>

#include "geometry/triangulation.hpp"
#include "geometry/two_view.hpp"
#include "model_scene.hpp"
#include "scenes.hpp"

namespace orbslam {
namespace {

using testing::make_two_view_scene;
using testing::SceneShape;

using FundamentalScene = testing::ModelScene<best_fundamental>;

TEST(FitFundamental, IsTheOneOfTheMotion) {
  const Pose T_21 = testing::sideways_motion();
  const auto scene = make_two_view_scene(SceneShape::general, T_21, 60, 0, 1);
  const FundamentalScene data(scene);
  const Eigen::Matrix3d F_21 = fit_fundamental(data.pairs, {0, 7, 14, 21, 28, 35, 42, 49},
                                               data.normalization_1, data.normalization_2);
  Eigen::Matrix3d K;
  K << 520, 0, 320, 0, 525, 240, 0, 0, 1;
  Eigen::Matrix3d expected = fundamental_matrix(T_21, Pose(), K, K).normalized();
  if (expected.cwiseProduct(F_21).sum() < 0) expected = -expected;
  EXPECT_LT((F_21.normalized() - expected).norm(), 1e-4);
  const Eigen::Vector3d d = Eigen::JacobiSVD<Eigen::Matrix3d>(F_21).singularValues();
  EXPECT_LT(d[2], 1e-12 * d[0]);
}

TEST(BestFundamental, ScoreCountsLineDistancesInBothDirections) {
  const auto scene =
      make_two_view_scene(SceneShape::general, testing::sideways_motion(), 200, 1, 2, 0.2);
  const FundamentalScene data(scene);
  const double sigma = 1.5;
  const ScoredModel best = data.best(draw_samples(200, 50, 3), sigma);
  double score = 0;
  std::size_t n_inliers = 0;
  for (std::size_t i = 0; i < 200; ++i) {
    const Eigen::Vector3d x_1 = scene.initial[i].cast<double>().homogeneous();
    const Eigen::Vector3d x_2 = scene.current[i].cast<double>().homogeneous();
    const auto chi = [&](const Eigen::Vector3d& line, const Eigen::Vector3d& x) {
      return std::pow(line.dot(x) / line.head<2>().norm() / sigma, 2);
    };
    const double chi_2 = chi(best.matrix * x_1, x_2);
    const double chi_1 = chi(best.matrix.transpose() * x_2, x_1);
    if (chi_1 <= 3.841) score += 5.991 - chi_1;
    if (chi_2 <= 3.841) score += 5.991 - chi_2;
    const bool inlier = chi_1 <= 3.841 && chi_2 <= 3.841;
    n_inliers += inlier ? 1 : 0;
    EXPECT_EQ(best.inliers[i] != 0, inlier);
  }
  EXPECT_NEAR(best.score, score, 1e-6);
  EXPECT_EQ(best.n_inliers, n_inliers);
  EXPECT_GT(n_inliers, 100U);
}

TEST(BestFundamental, MatchesTheReferencePerSample) {
  for (const std::string set : {"init_lowparallax", "init_planar_ok", "init_nonplanar"}) {
    // float32 in the reference moves single pairs over the gate.
    EXPECT_LE(testing::n_scored_otherwise<FundamentalScene>(set, "out_scores_F"), 4) << set;
  }
}

}  // namespace
}  // namespace orbslam
