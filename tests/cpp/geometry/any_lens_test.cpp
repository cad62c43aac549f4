// SPDX-License-Identifier: BSD-3-Clause
// Poses and points by rays: the same results through every kind of lens.
#include <gtest/gtest.h>

#include <random>

#include "geometry/pnp_ransac.hpp"
#include "geometry/two_view.hpp"
#include "scenes.hpp"

namespace orbslam {
namespace {

using testing::normal;
using testing::TestLens;
using testing::uniform;

constexpr double kRadiansPerDegree = 0.017453292519943295;

/// A fisheye lens that shows 200 degrees across.
std::shared_ptr<const Camera> very_wide_camera() {
  CameraOptions options;
  options.image_size = {640, 640};
  options.model = std::make_shared<CameraModel>(
      "double_sphere", std::vector<double>{160, 160, 320, 320, -0.2, 0.6}, options.image_size);
  return std::make_shared<Camera>(options);
}

std::vector<std::shared_ptr<const Camera>> all_cameras() {
  return {testing::make_camera(TestLens::none), testing::make_camera(TestLens::distorted),
          testing::make_camera(TestLens::fisheye), very_wide_camera()};
}

/// A keypoint off by the noise in the image itself.
Eigen::Vector2d disturbed(const Camera& camera, const Eigen::Vector2d& pixel, double noise,
                          std::mt19937_64& random) {
  const Eigen::Vector2d shift(noise * normal(random), noise * normal(random));
  return camera.from_image((camera.to_image(pixel) + shift).cast<float>()).cast<double>();
}

/// A direction that the camera shows, and its pixel.
Eigen::Vector3d shown_ray(const Camera& camera, std::mt19937_64& random, Eigen::Vector2d& pixel) {
  const ImageSize size = camera.image_size();
  for (;;) {
    const Eigen::Vector2f raw(static_cast<float>(uniform(random, 0, size.width)),
                              static_cast<float>(uniform(random, 0, size.height)));
    pixel = camera.from_image(raw).cast<double>();
    const Eigen::Vector3d ray = camera.ray(pixel.x(), pixel.y());
    if (ray.allFinite()) return ray.normalized();
  }
}

TEST(AnyLens, PnpFindsThePoseThroughOutliers) {
  for (const auto& camera : all_cameras()) {
    std::mt19937_64 random(3);
    const Pose T_cw = Pose::exp((Vector6d() << 0.3, -0.5, 0.2, 0.4, -1, 0.7).finished());
    PnpProblem problem;
    problem.camera = camera;
    constexpr int kPoints = 120;
    problem.points.resize(3, kPoints);
    problem.pixels.resize(2, kPoints);
    problem.sigma2 = Eigen::VectorXd::Ones(kPoints);
    for (int i = 0; i < kPoints; ++i) {
      Eigen::Vector2d pixel;
      const Eigen::Vector3d ray = shown_ray(*camera, random, pixel);
      problem.points.col(i) = T_cw.inverse() * Eigen::Vector3d(uniform(random, 2, 8) * ray);
      if (i % 4 == 0) shown_ray(*camera, random, pixel);  // anywhere: an outlier
      problem.pixels.col(i) = disturbed(*camera, pixel, 0.5, random);
    }
    PnpRansac ransac(problem, {}, 1);
    const auto pose = ransac.iterate(300);
    ASSERT_TRUE(pose);
    EXPECT_GE(pose->n_inliers, 85U);
    EXPECT_LT(testing::rotation_error_degrees(pose->T_cw, T_cw), 0.3);
    EXPECT_LT((pose->T_cw.center() - T_cw.center()).norm(), 0.05);
    for (std::size_t i = 1; i < kPoints; i += 4) EXPECT_EQ(pose->inliers[i], 1) << i;
  }
}

struct TwoViews {
  std::vector<Eigen::Vector2f> initial, current;
  std::vector<int> matches;
  std::vector<Eigen::Vector3d> points;
};

/// Points around the camera, or on a plane before it.
TwoViews two_views(const Camera& camera, const Pose& T_21, bool planar, std::mt19937_64& random) {
  TwoViews views;
  const Eigen::Vector3d plane_normal(0.3, 0.2, -1);
  while (views.points.size() < 400) {
    Eigen::Vector2d pixel_1, pixel_2;
    const Eigen::Vector3d ray = shown_ray(camera, random, pixel_1);
    const double depth = planar ? -6.0 / plane_normal.dot(ray) : uniform(random, 3, 9);
    const Eigen::Vector3d point = depth * ray;
    if (!(depth > 1 && depth < 20) || !camera.project(T_21 * point, pixel_2)) continue;
    if (!camera.bounds().contains(pixel_2.x(), pixel_2.y())) continue;
    views.points.push_back(point);
    views.initial.push_back(disturbed(camera, pixel_1, 0.3, random).cast<float>());
    views.current.push_back(disturbed(camera, pixel_2, 0.3, random).cast<float>());
    views.matches.push_back(static_cast<int>(views.matches.size()));
  }
  return views;
}

TEST(AnyLens, TwoViewsGiveMotionAndPoints) {
  const Pose T_21 = testing::sideways_motion();
  for (const auto& camera : all_cameras()) {
    std::mt19937_64 random(5);
    const TwoViews views = two_views(*camera, T_21, false, random);
    const TwoViewResult result = reconstruct_two_views(
        {views.initial, views.current, views.matches, *camera}, {}, 2, nullptr);
    ASSERT_TRUE(result.success()) << to_string(result.outcome);
    EXPECT_EQ(result.model, TwoViewModel::fundamental);
    EXPECT_LT(testing::rotation_error_degrees(result.T_21, T_21), 0.5);
    const double cosine = result.T_21.translation().dot(T_21.translation().normalized());
    EXPECT_GT(cosine, std::cos(3 * kRadiansPerDegree));
    int n = 0;
    for (std::size_t i = 0; i < views.points.size(); ++i) {
      if (!result.triangulated[i]) continue;
      const Eigen::Vector3d scaled = result.points[i] * T_21.translation().norm();
      n += (scaled - views.points[i]).norm() < 0.2 * views.points[i].norm() ? 1 : 0;
    }
    EXPECT_GT(n, 300);
  }
}

TEST(AnyLens, APlaneHasTheTrueMotionAmongItsTwo) {
  const Pose T_21 = testing::sideways_motion();
  for (const auto& camera : all_cameras()) {
    std::mt19937_64 random(6);
    const TwoViews views = two_views(*camera, T_21, true, random);
    const TwoViewResult result = reconstruct_two_views(
        {views.initial, views.current, views.matches, *camera}, {}, 2, nullptr);
    EXPECT_EQ(result.model, TwoViewModel::homography);
    double best = -1;
    if (result.success()) best = result.T_21.translation().dot(T_21.translation().normalized());
    for (const TwoViewMotion& motion : result.alternatives) {
      best = std::max(best, motion.T_21.translation().dot(T_21.translation().normalized()));
    }
    EXPECT_GT(best, std::cos(3 * kRadiansPerDegree)) << to_string(result.outcome);
  }
}

// The noise is that of the image, so as many matches are inliers as the gate says, with distortion
// too.
TEST(AnyLens, AsManyMatchesAreInliersThroughEveryLens) {
  const Pose T_21 = testing::sideways_motion();
  std::vector<double> shares;
  for (const auto& camera : all_cameras()) {
    std::mt19937_64 random(7);
    const TwoViews views = two_views(*camera, T_21, false, random);
    const TwoViewMotion motion =
        place_points({views.initial, views.current, views.matches, *camera}, T_21, 0.3);
    int n = 0;
    for (const Eigen::Vector3d& point : motion.points) n += point.norm() > 0 ? 1 : 0;
    shares.push_back(n / 400.0);
  }
  for (const double share : shares) EXPECT_NEAR(share, shares[0], 0.04);
}

}  // namespace
}  // namespace orbslam
