// SPDX-License-Identifier: BSD-3-Clause
#include "loops/upright.hpp"

#include <gtest/gtest.h>

#include "loops/loop_correction.hpp"
#include "loops/map_merge.hpp"
#include "loops/ring_scene.hpp"
#include "map/map_transform.hpp"

namespace orbslam {
namespace {

using namespace testing;

// Turns the scene's -y, which is up in the real world, to z.
const Eigen::Quaterniond kUp(Eigen::AngleAxisd(-1.5707963267948966, Eigen::Vector3d::UnitX()));

Eigen::Vector3d up_in_camera(const Pose& T_cw) {
  return T_cw.rotation() * Eigen::Vector3d::UnitZ();
}

/// Turns a map of the scene upright.
void set_up(RingScene& scene, MapIndex which) {
  const Similarity S(1, kUp, Eigen::Vector3d(1, 2, 3));
  const bool has_matched = scene.map.map_of(scene.matched()) == which;
  transform_map(scene.map, which, S);
  scene.map.set_upright(which);
  if (has_matched) scene.loop.S_cw = scene.loop.S_cw * S.inverse();
}

/// An error of the loop's measurement about the camera's optical axis.
void roll_loop(RingScene& scene, double angle) {
  Vector7d error = Vector7d::Zero();
  error(2) = angle;
  scene.loop.S_cw = Similarity::exp(error) * scene.loop.S_cw;
  scene.loop.S_cm = scene.loop.S_cw * Similarity(scene.map.T_cw(scene.matched())).inverse();
}

TEST(UprightCorrection, KeepsThePlaceAndTheNearestYaw) {
  const Pose T_cw(
      Eigen::Quaterniond(Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, 2, -1).normalized())),
      Eigen::Vector3d(0.3, -2, 1));
  const Eigen::Quaterniond yaw(Eigen::AngleAxisd(2.5, Eigen::Vector3d::UnitZ()));
  const Eigen::Vector3d tilt_axis(0.6, 0.8, 0);
  for (const double tilt : {0.0, 0.03, 0.06}) {
    const Eigen::Quaterniond off(Eigen::AngleAxisd(tilt, tilt_axis));
    const Similarity S_cw(1.5, T_cw.rotation() * off * yaw, Eigen::Vector3d(4, 5, 6));
    const auto turn = upright_correction(T_cw, S_cw);
    ASSERT_EQ(turn.has_value(), tilt < 0.05);
    if (!turn) continue;
    const Similarity corrected = S_cw * *turn;
    EXPECT_LT(corrected.rotation().angularDistance(T_cw.rotation() * yaw), 1e-9);
    EXPECT_LT((corrected.pose().center() - S_cw.pose().center()).norm(), 1e-12);
    EXPECT_NEAR(corrected.scale(), 1.5, 1e-12);
  }
}

TEST(UprightLoop, MovesFourDegreesOfFreedom) {
  RingScene scene;
  set_up(scene, 0);
  std::vector<Eigen::Vector3d> up;
  for (std::size_t k = 0; k < scene.truth.size(); ++k) {
    up.push_back(up_in_camera(scene.map.T_cw(RingScene::id(k))));
  }
  const Pose matched = scene.map.T_cw(scene.matched());
  roll_loop(scene, 0.01);
  LoopCorrection correction = plan_loop_correction(scene.map, scene.loop, true);
  EXPECT_TRUE(correction.upright);
  optimize_essential_graph(correction, nullptr);
  ASSERT_TRUE(apply_loop_correction(scene.map, correction).applied);
  EXPECT_EQ(scene.violations(), "");
  for (std::size_t k = 0; k < up.size(); ++k) {
    EXPECT_LT((up_in_camera(scene.map.T_cw(RingScene::id(k))) - up[k]).norm(), 1e-9) << k;
  }
  // The last keyframe is where it was in the real world, although the loop was measured askew.
  const std::size_t last = scene.truth.size() - 1;
  const auto m = static_cast<std::size_t>(scene.matched().value);
  const Pose expected = scene.truth[last] * scene.truth[m].inverse() * matched;
  const Pose is = scene.map.T_cw(scene.current());
  EXPECT_LT((is.center() - expected.center()).norm(), 0.02);
  EXPECT_LT(is.rotation().angularDistance(expected.rotation()), 2e-3);
}

TEST(UprightLoop, ThatContradictsGravityMovesAllDegreesOfFreedom) {
  RingScene scene;
  set_up(scene, 0);
  roll_loop(scene, 0.1);
  EXPECT_FALSE(plan_loop_correction(scene.map, scene.loop, true).upright);
}

RingOptions two_maps(const Eigen::Vector3d& axis) {
  RingOptions options;
  options.turn_drift = 0;
  options.second_map_from = 33;
  options.S_21 = Similarity(1, Eigen::Quaterniond(Eigen::AngleAxisd(2.2, axis.normalized())),
                            Eigen::Vector3d(40, -7, 300));
  return options;
}

TEST(UprightMerge, MovesFourDegreesOfFreedom) {
  RingScene scene(two_maps(Eigen::Vector3d::UnitY()));
  set_up(scene, 0);
  set_up(scene, 1);
  roll_loop(scene, 0.01);
  const MapMerge merge = plan_map_merge(scene.map, scene.loop, true);
  EXPECT_EQ(merge.kept, 0);
  EXPECT_NEAR(merge.S_km.scale(), 1, 1e-12);
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  EXPECT_LT((merge.S_km.rotation() * up - up).norm(), 1e-9);
  const Eigen::AngleAxisd turn(merge.S_km.rotation());
  EXPECT_NEAR(turn.angle(), 2.2, 2e-3);
  ASSERT_TRUE(apply_map_merge(scene.map, merge).applied);
  EXPECT_TRUE(scene.map.is_upright(0));
}

TEST(UprightMerge, TheUprightMapIsKeptThoughYounger) {
  RingScene scene(two_maps(Eigen::Vector3d(0.3, -1, 0.5)));
  set_up(scene, 1);
  const Pose root = scene.map.T_cw(RingScene::id(33));
  const MapMerge merge = plan_map_merge(scene.map, scene.loop, true);
  EXPECT_EQ(merge.kept, 1);
  EXPECT_EQ(merge.moved, 0);
  ASSERT_TRUE(apply_map_merge(scene.map, merge).applied);
  EXPECT_EQ(scene.violations(), "");
  EXPECT_TRUE(scene.map.is_upright(1));
  const Pose T_world = scene.truth[33].inverse() * root;
  for (std::size_t k = 0; k < scene.truth.size(); ++k) {
    const Pose expected = scene.truth[k] * T_world;
    EXPECT_LT((scene.map.T_cw(RingScene::id(k)).matrix() - expected.matrix()).norm(), 1e-6);
  }
}

}  // namespace
}  // namespace orbslam
