// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/motion_check.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "scenes.hpp"

namespace orbslam {
namespace {

using testing::make_two_view_scene;
using testing::SceneShape;

struct CheckProblem {
  explicit CheckProblem(const testing::TwoViewScene& scene)
      : pairs(gather_pairs(scene.initial, scene.current, scene.matches)),
        inliers(scene.matches.size(), 1),
        camera(scene.camera),
        motion{scene.T_21.rotation_matrix(), scene.T_21.translation().normalized()} {}
  MotionSupport check(double max_squared_error = 4) const {
    return check_motion(motion, pairs, inliers, *camera, max_squared_error);
  }
  PointPairs pairs;
  std::vector<std::uint8_t> inliers;
  std::shared_ptr<const Camera> camera;
  Motion motion;
};

TEST(CheckMotion, PlacesThePointsOfTheTrueMotion) {
  const auto scene =
      make_two_view_scene(SceneShape::general, testing::sideways_motion(), 100, 0, 1);
  const CheckProblem problem(scene);
  const MotionSupport support = problem.check();
  EXPECT_EQ(support.n_good, 100U);
  const double scale = 1 / scene.T_21.translation().norm();
  std::vector<double> parallaxes;
  for (std::size_t i = 0; i < 100; ++i) {
    EXPECT_LT((support.points[i] - scale * scene.points[i]).norm(), 1e-3 * scale * 9);
    EXPECT_EQ(support.triangulated[i], 1);
    parallaxes.push_back(testing::degrees_between(
        scene.points[i], scene.points[i] - scene.T_21.inverse().translation()));
  }
  std::sort(parallaxes.rbegin(), parallaxes.rend());
  EXPECT_NEAR(support.parallax, parallaxes[50], 1e-3);
}

TEST(CheckMotion, CountsOnlyInliersAndTakesTheSmallestParallaxOfFew) {
  const auto scene =
      make_two_view_scene(SceneShape::general, testing::sideways_motion(), 100, 0, 1);
  CheckProblem problem(scene);
  std::fill(problem.inliers.begin() + 30, problem.inliers.end(), std::uint8_t{0});
  const MotionSupport support = problem.check();
  EXPECT_EQ(support.n_good, 30U);
  EXPECT_EQ(support.good[29], 1);
  EXPECT_EQ(support.good[30], 0);
  double least = 180;
  for (std::size_t i = 0; i < 30; ++i) {
    least =
        std::min(least, testing::degrees_between(
                            scene.points[i], scene.points[i] - scene.T_21.inverse().translation()));
  }
  EXPECT_NEAR(support.parallax, least, 1e-3);
  std::fill(problem.inliers.begin(), problem.inliers.end(), std::uint8_t{0});
  EXPECT_EQ(problem.check().parallax, 0);
}

TEST(CheckMotion, PointsBehindTheCamerasDoNotCount) {
  CheckProblem problem(
      make_two_view_scene(SceneShape::general, testing::sideways_motion(), 100, 0, 1));
  problem.motion.t = -problem.motion.t;
  EXPECT_EQ(problem.check().n_good, 0U);
}

TEST(CheckMotion, FarPointsCountButAreNotTriangulated) {
  // A thousand baselines away: the sign of the depth is noise.
  const Pose tiny(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-0.002, 0, 0));
  const MotionSupport support =
      CheckProblem(make_two_view_scene(SceneShape::general, tiny, 100, 0.3, 1)).check();
  EXPECT_GT(support.n_good, 80U);
  EXPECT_TRUE(std::any_of(support.points.begin(), support.points.end(),
                          [](const Eigen::Vector3d& p) { return p.z() < 0; }));
  for (std::size_t i = 0; i < 100; ++i) {
    if (support.points[i].z() < 0) {
      EXPECT_EQ(support.triangulated[i], 0);
    }
  }
}

TEST(CheckMotion, ReprojectionLimitIsInSquaredPixels) {
  auto scene = make_two_view_scene(SceneShape::general, testing::sideways_motion(), 100, 0, 1);
  for (auto& point : scene.current) point.y() += 3;  // across the epipolar lines: shared by both
  const CheckProblem problem(scene);
  EXPECT_EQ(problem.check(1.5 * 1.5 * 0.8).n_good, 0U);
  EXPECT_GT(problem.check(1.5 * 1.5 * 1.2).n_good, 90U);
}

TEST(CheckMotion, AgreesWithTheReferenceAtTheTrueMotion) {
  for (const std::string set :
       {"init_planar", "init_planar_ok", "init_nonplanar", "init_lowparallax"}) {
    const auto uv_1 = testing::golden<float>(set, "uv1"), uv_2 = testing::golden<float>(set, "uv2");
    const auto T = testing::golden<double>(set, "T21_true");
    PointPairs pairs;
    pairs.resize(uv_1.rows());
    for (std::size_t i = 0; i < uv_1.rows(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      pairs.u_1[k] = uv_1.at(i, 0);
      pairs.v_1[k] = uv_1.at(i, 1);
      pairs.u_2[k] = uv_2.at(i, 0);
      pairs.v_2[k] = uv_2.at(i, 1);
    }
    Motion motion;
    for (std::size_t i = 0; i < 9; ++i) {
      motion.R(static_cast<int>(i / 3), static_cast<int>(i % 3)) = T.at(i / 3, i % 3);
    }
    motion.t = Eigen::Vector3d(T.at(0, 3), T.at(1, 3), T.at(2, 3)).normalized();
    const MotionSupport support = check_motion(motion, pairs, std::vector<std::uint8_t>(300, 1),
                                               *testing::golden_camera(set), 4);
    EXPECT_EQ(static_cast<int>(support.n_good),
              testing::golden<int>(set, "out_checkRT_ngood").values[0]);
    EXPECT_NEAR(support.parallax,
                testing::golden<double>(set, "out_checkRT_parallax_deg").values[0], 1e-3);
    const auto good = testing::golden<std::uint8_t>(set, "out_checkRT_good");
    EXPECT_EQ(support.triangulated, good.values) << set;
  }
}

}  // namespace
}  // namespace orbslam
