// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include "base/errors.hpp"
#include "map_builder.hpp"

namespace orbslam::testing {
namespace {

using Children = std::set<KeyFrameId>;

/// Shares n points between a and b and recounts a.
void connect(MapBuilder& builder, std::int64_t a, std::int64_t b, int n) {
  builder.add_points(n, kfs({a, b}));
  builder.map.update_connections(kf(a));
}

TEST(SpanningTree, TheStrongestNeighbourBecomesTheParentOnce) {
  MapBuilder builder;
  builder.add_keyframes(2);
  connect(builder, 1, 0, 20);
  const KeyFrameId id = builder.add_keyframe(false);
  builder.add_points(16, kfs({2, 0}));
  builder.add_points(17, kfs({2, 1}));
  builder.map.update_connections(id);
  builder.map.publish(id);
  EXPECT_EQ(builder.map.find(id)->parent, kf(1));
  EXPECT_EQ(builder.map.find(kf(1))->children, Children{kf(2)});
  connect(builder, 2, 0, 50);
  EXPECT_EQ(builder.map.find(id)->parent, kf(1)) << "the parent is not chosen again";
  EXPECT_EQ(builder.violations(), "");
}

TEST(SpanningTree, AKeyframeWithoutNeighboursHangsProvisionallyUnderTheOneBefore) {
  MapBuilder builder;
  builder.add_keyframes(3);
  EXPECT_EQ(builder.map.find(kf(2))->parent, kf(1));
  EXPECT_FALSE(builder.map.find(kf(0))->parent.valid());
  EXPECT_EQ(builder.violations(), "");
  connect(builder, 2, 0, 16);
  EXPECT_EQ(builder.map.find(kf(2))->parent, kf(0));
  EXPECT_TRUE(builder.map.find(kf(1))->children.empty());
  EXPECT_EQ(builder.violations(), "");
}

TEST(SpanningTree, ADescendantIsNotChosenAsParent) {
  MapBuilder builder;
  builder.add_keyframes(3);  // 0 - 1 - 2, all provisional
  builder.map.set_parent(kf(2), kf(1));
  connect(builder, 1, 2, 30);  // the strongest neighbour of 1 is its child
  EXPECT_EQ(builder.map.find(kf(1))->parent, kf(0));
  EXPECT_EQ(builder.violations(), "");
}

TEST(SpanningTree, CyclesAreRefused) {
  MapBuilder builder;
  builder.add_keyframes(3);
  EXPECT_THROW(builder.map.set_parent(kf(1), kf(2)), StateError);
  EXPECT_THROW(builder.map.set_parent(kf(1), kf(1)), StateError);
  EXPECT_THROW(builder.map.set_parent(kf(0), kf(2)), StateError);
  EXPECT_THROW(builder.map.set_parent(kf(1), kf(7)), StateError);
  EXPECT_NO_THROW(builder.map.set_parent(kf(2), kf(0)));
  EXPECT_EQ(builder.violations(), "");
}

TEST(SpanningTree, ChildrenAreAdoptedByTheGreatestWeight) {
  // 1 dies; its children are 2, 3 and 4. Candidates grow: 0, then each adopted child.
  MapBuilder builder;
  builder.add_keyframes(5);
  connect(builder, 1, 0, 50);
  for (const std::int64_t child : {2, 3, 4}) connect(builder, child, 1, 60);
  for (const std::int64_t child : {2, 3, 4}) ASSERT_EQ(builder.map.find(kf(child))->parent, kf(1));
  connect(builder, 2, 0, 16);  // 2 knows the grandparent,
  connect(builder, 3, 2, 40);  // 3 knows 2, which becomes a candidate after its own adoption,
  connect(builder, 4, 3, 20);  // 4 knows 3 and, a little more, 2
  connect(builder, 4, 2, 25);
  ASSERT_TRUE(builder.erase_keyframe(kf(1)));
  EXPECT_EQ(builder.map.find(kf(2))->parent, kf(0));
  EXPECT_EQ(builder.map.find(kf(3))->parent, kf(2));
  EXPECT_EQ(builder.map.find(kf(4))->parent, kf(2));
  EXPECT_EQ(builder.map.find(kf(0))->children, Children{kf(2)});
  EXPECT_EQ(builder.violations(), "");
}

TEST(SpanningTree, ChildrenThatKnowNoCandidateGoToTheGrandparent) {
  MapBuilder builder;
  builder.add_keyframes(4);
  connect(builder, 1, 0, 50);
  connect(builder, 2, 1, 50);
  connect(builder, 3, 1, 50);
  ASSERT_TRUE(builder.erase_keyframe(kf(1)));
  EXPECT_EQ(builder.map.find(kf(2))->parent, kf(0));
  EXPECT_EQ(builder.map.find(kf(3))->parent, kf(0));
  EXPECT_EQ(builder.violations(), "");
}

TEST(SpanningTree, OnlyListedNeighboursAdopt) {
  // 3 shares 10 points with 0 (too few to be listed) and 20 with 2.
  MapBuilder builder;
  builder.add_keyframes(4);
  connect(builder, 1, 0, 50);
  connect(builder, 2, 1, 50);
  connect(builder, 3, 1, 50);
  connect(builder, 2, 0, 16);
  connect(builder, 3, 0, 10);
  connect(builder, 3, 2, 20);
  ASSERT_TRUE(builder.erase_keyframe(kf(1)));
  EXPECT_EQ(builder.map.find(kf(3))->parent, kf(2));
}

TEST(KeyframeDeath, NeighboursForgetItAndPointsLoseTheObservation) {
  MapBuilder builder;
  builder.add_keyframes(4);
  const MapPointId survives = builder.add_point(kfs({1, 0, 2, 3}));
  const MapPointId dies = builder.add_point(kfs({0, 1, 2}));
  builder.map.update_connections(kf(1));
  ASSERT_TRUE(builder.erase_keyframe(kf(1)));
  EXPECT_FALSE(builder.map.find(kf(1)));
  EXPECT_EQ(builder.map.n_keyframes(), 3U);
  EXPECT_EQ(builder.map.find(survives)->observation_count, 3);
  EXPECT_EQ(builder.map.find(survives)->reference_keyframe, kf(0));
  EXPECT_FALSE(builder.map.find(dies));
  EXPECT_EQ(builder.map.weight(kf(0), kf(1)), 0);
  EXPECT_FALSE(builder.map.erase_keyframe(kf(1))) << "the dead do not die again";
  EXPECT_EQ(builder.violations(), "");
}

TEST(KeyframeDeath, KeyframeZeroNeverDies) {
  MapBuilder builder;
  builder.add_keyframes(2);
  EXPECT_FALSE(builder.map.erase_keyframe(kf(0)));
  EXPECT_TRUE(builder.map.find(kf(0)));
  EXPECT_FALSE(builder.map.find(kf(0))->to_be_erased);
}

TEST(KeyframeDeath, ThePoseLivesOnThroughChainsOfDeadParents) {
  MapBuilder builder;
  builder.add_keyframes(4);
  connect(builder, 1, 0, 20);
  connect(builder, 2, 1, 20);
  connect(builder, 3, 2, 20);
  std::vector<Pose> before;
  for (int k = 0; k < 4; ++k) before.push_back(builder.map.T_cw(kf(k)));
  // Children first, so that the parents of the dead die as well.
  ASSERT_TRUE(builder.erase_keyframe(kf(3)));
  ASSERT_TRUE(builder.erase_keyframe(kf(2)));
  ASSERT_TRUE(builder.erase_keyframe(kf(1)));
  for (int k = 0; k < 4; ++k) {
    EXPECT_TRUE(builder.map.T_cw(kf(k)).matrix().isApprox(
        before[static_cast<std::size_t>(k)].matrix(), 1e-12));
  }
  // The living ancestor moves: the dead move rigidly with it.
  Vector6d xi;
  xi << 0.1, -0.2, 0.3, 1, 2, 3;
  const Pose T_0w = Pose::exp(xi);
  builder.map.set_pose(kf(0), T_0w);
  for (int k = 1; k < 4; ++k) {
    const Pose expected = before[static_cast<std::size_t>(k)] * before[0].inverse() * T_0w;
    EXPECT_TRUE(builder.map.T_cw(kf(k)).matrix().isApprox(expected.matrix(), 1e-12)) << k;
  }
  EXPECT_THROW(builder.map.T_cw(kf(17)), StateError);
  EXPECT_THROW(builder.map.T_cw(KeyFrameId()), StateError);
}

TEST(KeyframeDeath, AnUnprocessedKeyframeMayDie) {
  MapBuilder builder;
  builder.add_keyframes(2);
  const KeyFrameId id = builder.add_keyframe(false);
  builder.map.set_slot(id, 3, builder.add_point(kfs({0, 1})));
  const Pose pose = builder.map.T_cw(id);
  ASSERT_TRUE(builder.erase_keyframe(id));
  EXPECT_TRUE(builder.map.T_cw(id).matrix().isApprox(pose.matrix(), 1e-12));
  EXPECT_EQ(builder.map.n_keyframes(), 2U);
  EXPECT_EQ(builder.map.n_points(), 1U);
  EXPECT_EQ(builder.violations(), "");
}

TEST(Leases, DeferTheDeathUntilTheLastOneEnds) {
  MapBuilder builder;
  builder.add_keyframes(2);
  builder.map.begin_lease(kf(1));
  builder.map.begin_lease(kf(1));
  EXPECT_FALSE(builder.map.erase_keyframe(kf(1)));
  EXPECT_TRUE(builder.map.find(kf(1))->to_be_erased);
  builder.map.end_lease(kf(1));
  EXPECT_TRUE(builder.map.find(kf(1)));
  builder.map.end_lease(kf(1));
  EXPECT_FALSE(builder.map.find(kf(1)));
  EXPECT_NO_THROW(builder.map.end_lease(kf(1)));
  EXPECT_THROW(builder.map.begin_lease(kf(1)), StateError);
}

TEST(Leases, NobodyAskedNobodyDies) {
  MapBuilder builder;
  builder.add_keyframes(2);
  builder.map.begin_lease(kf(1));
  builder.map.end_lease(kf(1));
  EXPECT_TRUE(builder.map.find(kf(1)));
  EXPECT_THROW(builder.map.end_lease(kf(1)), StateError);
}

// OD-61: the request to cull is taken back.
TEST(Leases, ALoopEdgeProtectsForEverAndClearsTheRequest) {
  MapBuilder builder;
  builder.add_keyframes(3);
  builder.map.begin_lease(kf(2));
  EXPECT_FALSE(builder.map.erase_keyframe(kf(2)));
  builder.map.add_loop_edge(kf(2), kf(1));
  builder.map.end_lease(kf(2));
  ASSERT_TRUE(builder.map.find(kf(2)));
  EXPECT_FALSE(builder.map.find(kf(2))->to_be_erased);
  EXPECT_FALSE(builder.map.erase_keyframe(kf(2)));
  EXPECT_FALSE(builder.map.erase_keyframe(kf(1)));
  EXPECT_EQ(builder.map.find(kf(1))->loop_edges, Children{kf(2)});
  EXPECT_EQ(builder.map.find(kf(2))->loop_edges, Children{kf(1)});
  EXPECT_THROW(builder.map.add_loop_edge(kf(1), kf(1)), StateError);
  EXPECT_EQ(builder.violations(), "");
}

}  // namespace
}  // namespace orbslam::testing
