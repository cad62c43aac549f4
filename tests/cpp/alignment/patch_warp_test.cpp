// SPDX-License-Identifier: BSD-3-Clause
#include "alignment/patch_warp.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace orbslam {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

Camera camera(const Distortion& distortion = {}) {
  CameraOptions options;
  options.pinhole = {500, 510, 320, 240};
  options.distortion = distortion;
  options.image_size = {640, 480};
  return Camera(options);
}

const Pose kThere(Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Vector3d(1, 2, 3).normalized())),
                  Vector3d(0.1, -0.2, 0.3));

/// Where `to` sees the point of the plane z = depth of `from` that lies behind a raw pixel.
Vector2d carried(const Camera& from, const Pose& T_wc, const Vector2d& raw, double z,
                 const Camera& to, const Pose& T_cw) {
  const Eigen::Vector2f uv = from.from_image(raw.cast<float>());
  Vector2d pixel;
  EXPECT_TRUE(to.project(T_cw * (T_wc * from.unproject(uv.x(), uv.y(), z)), pixel));
  return to.to_image(pixel);
}

TEST(PatchWarp, SameCameraIsTheIdentity) {
  const Vector2d pixel(400, 100);
  const auto patch = parallel_patch(camera(), kThere.inverse(), pixel, 2.5);
  ASSERT_TRUE(patch);
  const auto warp = warp_of(*patch, camera(), kThere);
  ASSERT_TRUE(warp);
  EXPECT_LT((warp->pixel - pixel).norm(), 1e-9);
  EXPECT_LT((warp->A - Matrix2d::Identity()).norm(), 1e-9);
}

TEST(PatchWarp, HalfTheDistanceDoublesThePatch) {
  const auto patch = parallel_patch(camera(), Pose(), {320, 240}, 2);
  const Pose T_cw(Eigen::Matrix3d::Identity(), Vector3d(0, 0, -1));
  const auto warp = warp_of(*patch, camera(), T_cw);
  ASSERT_TRUE(warp);
  EXPECT_LT((warp->A - 2 * Matrix2d::Identity()).norm(), 1e-9);
}

TEST(PatchWarp, IsTheDerivativeOfThePixels) {
  for (const Distortion& lens : {Distortion{}, Distortion{0.2, -0.5, 0.002, -0.001, 0.1}}) {
    const Camera from = camera(lens), to = camera(lens);
    for (const Vector2d& pixel : {Vector2d(320, 240), Vector2d(500, 400), Vector2d(90, 60)}) {
      const double z = 1.7;
      const auto patch = parallel_patch(from, Pose(), pixel, z);
      ASSERT_TRUE(patch);
      const auto warp = warp_of(*patch, to, kThere);
      ASSERT_TRUE(warp);
      EXPECT_LT((warp->pixel - carried(from, Pose(), pixel, z, to, kThere)).norm(), 1e-3);
      for (const Vector2d& step : {Vector2d(4, 0), Vector2d(0, 4), Vector2d(-3, 3)}) {
        const Vector2d there = carried(from, Pose(), pixel + step, z, to, kThere);
        EXPECT_LT((warp->pixel + warp->A * step - there).norm(), 0.05) << pixel << step;
      }
    }
  }
}

TEST(PatchWarp, ThereIsNoneOfWhatCannotBeSeen) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(parallel_patch(camera(), Pose(), {320, 240}, 0));
  EXPECT_FALSE(parallel_patch(camera(), Pose(), {320, 240}, -1));
  EXPECT_FALSE(parallel_patch(camera(), Pose(), {320, 240}, nan));
  EXPECT_FALSE(parallel_patch(camera(), Pose(), {nan, 240}, 1));
  const auto patch = parallel_patch(camera(), Pose(), {320, 240}, 2);
  ASSERT_TRUE(patch);
  const Pose behind(Eigen::Matrix3d::Identity(), Vector3d(0, 0, -3));
  EXPECT_FALSE(warp_of(*patch, camera(), behind));
  const Pose edge_on(Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 2, Vector3d::UnitY())),
                     Vector3d(-2, 0, 3));
  EXPECT_FALSE(warp_of(*patch, camera(), edge_on));
}

TEST(WarpedLevel, FollowsTheMagnification) {
  const ScalePyramid scales(1.2F, 8);
  const Matrix2d I = Matrix2d::Identity();
  EXPECT_EQ(warped_level(scales, 3, I), 3);
  EXPECT_EQ(warped_level(scales, 3, 1.2 * I), 4);
  EXPECT_EQ(warped_level(scales, 3, 1.3 * I), 4);
  EXPECT_EQ(warped_level(scales, 3, 1.4 * I), 5);
  EXPECT_EQ(warped_level(scales, 3, 0.5 * I), 0);
  EXPECT_EQ(warped_level(scales, 6, 9 * I), 7);
  EXPECT_EQ(warped_level(scales, 2, 0 * I), 2);
}

}  // namespace
}  // namespace orbslam
