// SPDX-License-Identifier: BSD-3-Clause
// Corrections of maps that have changed since they were planned or prepared.
#include "loops/prepared_correction.hpp"

#include <gtest/gtest.h>

#include "loops/correct_ring.hpp"
#include "map/keyframe_insertion.hpp"

namespace orbslam {
namespace {

using namespace testing;

/// A keyframe as the tracker inserts it, a bit farther along, with points of its own depths.
KeyFrameId insert(RingScene& scene, int k) {
  std::vector<std::size_t> seen;
  TrackedFrame frame(scene.make_frame(k, seen));
  const auto c = static_cast<std::size_t>(scene.current().value);
  const Pose ahead(Eigen::Quaterniond(1, 0, -0.05, 0), Eigen::Vector3d(-0.2, 0, 0.01));
  frame.T_cw = ahead * scene.map.T_cw(RingScene::id(c));
  return insert_keyframe(scene.map, frame, true);
}

TEST(PreparedCorrection, KeyframesThatNobodyPlannedForFollow) {
  RingScene scene;
  const KeyFrameId waiting = insert(scene, 66);
  const LoopCorrection correction = planned(scene);
  EXPECT_EQ(correction.keyframes.back(), scene.current());
  const KeyFrameId late = insert(scene, 67);
  const PreparedCorrection prepared(scene.map, correction);
  const KeyFrameId last = insert(scene, 68);
  struct Seen {
    MapPointId point;
    Eigen::Vector3d p_c;
  };
  std::vector<std::pair<KeyFrameId, Seen>> before;
  const Pose T_rel = scene.map.T_cw(waiting) * scene.map.T_cw(scene.current()).inverse();
  for (const KeyFrameId id : {waiting, late, last}) {
    for (const MapPointId point : scene.map.find(id)->map_points) {
      if (!scene.map.find(point)) continue;
      before.push_back({id, {point, scene.map.T_cw(id) * scene.map.find(point)->position}});
    }
  }
  ASSERT_GT(before.size(), 100U);
  ASSERT_TRUE(prepared.commit(scene.map).applied);
  EXPECT_EQ(scene.violations(), "");
  for (const KeyFrameId id : {waiting, late, last}) {
    const Pose now = scene.map.T_cw(id) * scene.map.T_cw(scene.current()).inverse();
    EXPECT_TRUE(now.matrix().isApprox(T_rel.matrix(), 1e-9));
  }
  for (const auto& [id, seen] : before) {
    const Eigen::Vector3d p_c = scene.map.T_cw(id) * scene.map.find(seen.point)->position;
    EXPECT_TRUE(p_c.isApprox(seen.p_c, 1e-9));
  }
}

TEST(PreparedCorrection, FollowersChangeScaleToo) {
  RingScene scene(single_camera());
  std::vector<std::size_t> seen;
  const Pose T_rel(Eigen::Quaterniond(1, 0, -0.05, 0), Eigen::Vector3d(-0.2, 0, 0.01));
  const auto frame = scene.make_frame(66, seen);
  const KeyFrameId waiting = scene.map.add_keyframe(frame, T_rel * scene.map.T_cw(scene.current()));
  correct(scene);
  const KeyFrame &follower = *scene.map.find(waiting), &leader = *scene.map.find(scene.current());
  EXPECT_NEAR(follower.scale, leader.scale, 1e-12);
  const Pose now = follower.T_cw * leader.T_cw.inverse();
  EXPECT_TRUE(now.translation().isApprox(leader.scale * T_rel.translation(), 1e-9));
  EXPECT_NEAR(now.rotation().angularDistance(T_rel.rotation()), 0, 1e-9);
}

TEST(PreparedCorrection, PointsMayDieMeanwhile) {
  RingScene scene;
  const LoopCorrection correction = planned(scene);
  int n = 0;
  for (const LoopCorrection::Fusion& fusion : correction.fusions) {
    if (++n % 7 == 0) scene.map.erase_point(fusion.point);
    if (n % 5 == 0 && fusion.replaced.valid()) scene.map.erase_point(fusion.replaced);
  }
  // And a keyframe of the group.
  const KeyFrameId neighbour = correction.group[1];
  EXPECT_TRUE(scene.map.erase_keyframe(neighbour));
  const LoopCorrectionResult result = apply_loop_correction(scene.map, correction);
  EXPECT_TRUE(result.applied);
  EXPECT_GT(result.n_fused, 0);
  EXPECT_LT(result.n_fused, static_cast<int>(correction.fusions.size()));
  EXPECT_EQ(scene.violations(), "");
  EXPECT_LT(scene.largest_reprojection_error(), 1.0);
}

// OD-105: what was replaced after planning is resolved when it is written.
TEST(PreparedCorrection, ReplacedPointsAreFollowed) {
  RingScene scene;
  const LoopCorrection correction = planned(scene);
  const LoopCorrection::Fusion& fusion = correction.fusions.front();
  ASSERT_TRUE(fusion.replaced.valid());
  const MapPointId other =
      scene.map.add_point(scene.map.find(fusion.point)->position, scene.matched(), 0);
  scene.physical.push_back(scene.physical[static_cast<std::size_t>(fusion.point.value)]);
  scene.map.replace_point(fusion.point, other);
  ASSERT_EQ(scene.map.resolve(fusion.point), other);
  EXPECT_EQ(apply_loop_correction(scene.map, correction).n_fused,
            static_cast<int>(correction.fusions.size()));
  EXPECT_EQ(scene.map.resolve(fusion.replaced), other);
  EXPECT_EQ(scene.violations(), "");
}

}  // namespace
}  // namespace orbslam
