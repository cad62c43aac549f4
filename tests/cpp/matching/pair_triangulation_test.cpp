// SPDX-License-Identifier: BSD-3-Clause
#include "matching/pair_triangulation.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "matching/scenes.hpp"

namespace orbslam {
namespace {

using namespace testing;

// One point seen by two cameras; everything about the second sight can be changed.
struct FramePair {
  Eigen::Vector3d point{0.5, 0.2, 5};
  Pose T_1w, T_2w = at(1);
  double depth_1 = -1, depth_2 = -1;  // as measured; negative: none
  std::int32_t level_1 = 0, level_2 = 0;
  double offset_v = 0;  // error of the second feature, pixels
  std::shared_ptr<const Camera> camera_1 = synthetic_camera(), camera_2 = camera_1;

  std::optional<Eigen::Vector3d> triangulate() const {
    const auto frame_1 = frame(*camera_1, camera_1, T_1w, depth_1, level_1, 0);
    const auto frame_2 = frame(*camera_2, camera_2, T_2w, depth_2, level_2, offset_v);
    return PairTriangulation(*frame_1, T_1w, *frame_2, T_2w)(0, 0);
  }
  bool accepted() const { return triangulate().has_value(); }

  std::shared_ptr<Frame> frame(const Camera& camera, const std::shared_ptr<const Camera>& shared,
                               const Pose& T_cw, double depth, std::int32_t level,
                               double offset) const {
    const Eigen::Vector2d uv = camera.pinhole().project(T_cw * point);
    FeatureSpec spec;
    spec.u = static_cast<float>(uv.x());
    spec.v = static_cast<float>(uv.y() + offset);
    spec.depth = static_cast<float>(depth);
    spec.level = level;
    return make_synthetic_frame(0, {spec}, shared);
  }
};

TEST(PairTriangulation, FindsTheTruePointFromTwoRays) {
  const FramePair pair;
  const auto found = pair.triangulate();
  ASSERT_TRUE(found);
  EXPECT_LT((*found - pair.point).norm(), 1e-4);
}

TEST(PairTriangulation, SingleCamerasNeedParallax) {
  // cos 0.9998 is 0.02 rad: 0.1 m at 5 m.
  FramePair pair;
  pair.point = {0, 0, 5};
  pair.T_2w = at(0.099);
  EXPECT_FALSE(pair.accepted());
  pair.T_2w = at(0.101);
  EXPECT_TRUE(pair.accepted());
}

TEST(PairTriangulation, WideRaysAreBetterThanMeasuredDepth) {
  FramePair pair;
  pair.depth_1 = 5.02;
  pair.depth_2 = 5.03;
  const auto found = pair.triangulate();
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->z(), 5, 1e-3);
}

TEST(PairTriangulation, MeasuredDepthIsBetterThanNarrowRays) {
  FramePair pair;
  pair.T_2w = at(0.05);  // half the baseline of the rig
  pair.depth_1 = 5.02;
  auto found = pair.triangulate();
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->z(), 5.02, 1e-6);

  pair.depth_1 = -1;
  pair.depth_2 = 5.03;
  found = pair.triangulate();
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->z(), 5.03, 1e-6);
}

// OD-88: both parallaxes are asked, not only the first.
TEST(PairTriangulation, OfTwoDepthsTheNearerDecides) {
  FramePair pair;
  pair.T_2w = at(0, 0, 0.3);  // moved towards the point
  pair.depth_1 = 5.02;
  pair.depth_2 = 4.71;
  auto found = pair.triangulate();
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->z(), 0.3 + 4.71, 1e-6);

  std::swap(pair.T_1w, pair.T_2w);
  std::swap(pair.depth_1, pair.depth_2);
  found = pair.triangulate();
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->z(), 0.3 + 4.71, 1e-6);
}

TEST(PairTriangulation, DepthWithoutParallaxAtAll) {
  FramePair pair;
  pair.T_2w = Pose();
  EXPECT_FALSE(pair.accepted());
  pair.depth_1 = pair.depth_2 = 5;  // equally good: the first is taken
  EXPECT_TRUE(pair.accepted());
}

TEST(PairTriangulation, RaysThatMeetBehindTheCameras) {
  FramePair pair;
  pair.point = {0.5, 0, -5};
  EXPECT_FALSE(pair.accepted());
}

TEST(PairTriangulation, ReprojectionGateWithoutDepth) {
  // sqrt(5.991) = 2.4477 pixels on level 0, 1.2 times as much on level 1.
  FramePair pair;
  pair.T_2w = at(0.02);
  pair.depth_1 = 5;
  for (const std::int32_t level : {0, 1}) {
    const double limit = std::sqrt(5.991) * synthetic_scales()->scale(level);
    pair.level_2 = level;
    pair.offset_v = limit - 0.001;
    EXPECT_TRUE(pair.accepted()) << level;
    pair.offset_v = limit + 0.001;
    EXPECT_FALSE(pair.accepted()) << level;
  }
}

TEST(PairTriangulation, ReprojectionGateWithDepth) {
  // The first depth decides; the second contradicts it by `error` pixels in the right image.
  FramePair pair;
  pair.T_2w = at(0.02);
  pair.depth_1 = 5;
  for (const double sign : {-0.001, 0.001}) {
    const double error = std::sqrt(7.8) + sign;
    pair.depth_2 = 40.0 / (40.0 / 5.0 - error);
    EXPECT_EQ(pair.accepted(), sign < 0);
  }
}

// OD-89: the second right column is not judged with the first camera's baseline.
TEST(PairTriangulation, EachCameraHasItsOwnBaseline) {
  FramePair pair;
  pair.camera_2 = synthetic_camera(80);
  pair.depth_1 = pair.depth_2 = 5;
  EXPECT_TRUE(pair.accepted());
}

TEST(PairTriangulation, LevelsMustAgreeWithDistances) {
  // Equal distances: 1.8 lies between three and four levels of 1.2.
  FramePair pair;
  pair.point = {0.5, 0, 5};
  for (const std::int32_t difference : {0, 1, 2, 3, 4}) {
    pair.level_1 = difference;
    pair.level_2 = 0;
    EXPECT_EQ(pair.accepted(), difference <= 3) << difference;
    pair.level_1 = 0;
    pair.level_2 = difference;
    EXPECT_EQ(pair.accepted(), difference <= 3) << -difference;
  }
  // Twice as far in the second image: coarser by 3.8 levels in the first is what to expect.
  pair.T_2w = at(0.5, 0, -5);
  pair.level_1 = 6;
  pair.level_2 = 0;
  EXPECT_TRUE(pair.accepted());
  pair.level_1 = 0;
  EXPECT_FALSE(pair.accepted());
}

TEST(PairTriangulation, RandomPerfectPairsAreFoundWhereTheyAre) {
  std::mt19937_64 random(5);
  for (int i = 0; i < 500; ++i) {
    FramePair pair;
    pair.point = {uniform(random, -2, 2), uniform(random, -2, 2), uniform(random, 3, 8)};
    pair.T_2w = small_motion(random, 0.1, 0.3) * at(0.5);
    if (random() % 2) pair.depth_1 = (pair.T_1w * pair.point).z();
    if (random() % 2) pair.depth_2 = (pair.T_2w * pair.point).z();
    const auto found = pair.triangulate();
    if (found) {
      EXPECT_LT((*found - pair.point).norm(), 1e-3) << i;
    } else {
      EXPECT_TRUE(pair.depth_1 < 0 && pair.depth_2 < 0) << i;
    }
  }
}

}  // namespace
}  // namespace orbslam
