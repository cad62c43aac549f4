// SPDX-License-Identifier: BSD-3-Clause
#include "loops/essential_graph.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "map/map_builder.hpp"

namespace orbslam {
namespace {

using namespace testing;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

using IdPair = std::pair<std::int64_t, std::int64_t>;

/// Keyframes 0 .. 7; each shares 20 points with the one before it. 7 sees what 1 saw.
class EssentialGraph : public ::testing::Test {
 protected:
  void SetUp() override {
    builder.add_keyframes(8);
    for (std::int64_t k = 1; k < 8; ++k) share(20, k - 1, k);
    correction.loop.current = kf(7);
    correction.loop.matched = kf(1);
    group.keyframes = kfs({7, 6});
    for (const KeyFrameId id : group.keyframes) {
      group.corrected.push_back(Similarity(builder.map.T_cw(id)) * kShift);
    }
    group.shared = {{{kf(6), 20}}, {{kf(5), 20}, {kf(7), 20}}};
  }
  void share(int n, std::int64_t a, std::int64_t b) {
    builder.add_points(n, kfs({a, b}));
    builder.map.update_connections(kf(a));
    builder.map.update_connections(kf(b));
  }
  void build() { build_essential_graph(builder.map, group, correction); }
  std::vector<IdPair> pairs() const {
    std::vector<IdPair> found;
    for (const PoseGraph::Edge& edge : correction.graph.edges) {
      found.emplace_back(correction.keyframes[edge.i].value, correction.keyframes[edge.j].value);
    }
    return found;
  }
  std::vector<IdPair> with_tree(std::vector<IdPair> pairs) const {
    for (std::int64_t k = 1; k < 8; ++k) pairs.emplace_back(k, k - 1);
    return pairs;
  }
  const PoseGraph::Edge& edge(std::int64_t a, std::int64_t b) const {
    for (const PoseGraph::Edge& edge : correction.graph.edges) {
      if (correction.keyframes[edge.i] == kf(a) && correction.keyframes[edge.j] == kf(b)) {
        return edge;
      }
    }
    throw std::logic_error("no such edge");
  }

  const Similarity kShift{1.25, Eigen::Quaterniond(0.9, 0.1, 0, 0.1), Eigen::Vector3d(1, 2, 3)};
  MapBuilder builder;
  CorrectedGroup group;
  LoopCorrection correction;
};

TEST_F(EssentialGraph, ThePairAndTheTreeAreAlwaysThere) {
  build();
  EXPECT_EQ(correction.keyframes, builder.map.keyframe_ids());
  EXPECT_THAT(correction.graph.fixed, ElementsAre(0, 1, 0, 0, 0, 0, 0, 0));
  EXPECT_THAT(pairs(), ::testing::UnorderedElementsAreArray(with_tree({{7, 1}})));
}

TEST_F(EssentialGraph, TheGroupStartsCorrectedTheOthersWhereTheyAre) {
  build();
  for (std::size_t k = 0; k < 8; ++k) {
    const Similarity at(builder.map.T_cw(correction.keyframes[k]));
    EXPECT_EQ(correction.uncorrected[k].matrix(), at.matrix());
    const Similarity start = k < 6 ? at : at * kShift;
    EXPECT_TRUE(correction.graph.S_iw[k].matrix().isApprox(start.matrix(), 1e-12)) << k;
  }
}

TEST_F(EssentialGraph, NewEdgesAgreeWithTheCorrectionOldOnesWithTheMap) {
  group.links = {{kf(6), kf(2)}};
  group.shared[1] = {{kf(2), 100}, {kf(5), 20}, {kf(7), 20}};
  build();
  const auto& start = correction.graph.S_iw;
  const auto& old = correction.uncorrected;
  const auto agrees = [](const PoseGraph::Edge& e, const std::vector<Similarity>& poses) {
    return (e.S_ji * poses[e.i]).matrix().isApprox(poses[e.j].matrix(), 1e-12);
  };
  EXPECT_TRUE(agrees(edge(7, 1), start));
  EXPECT_TRUE(agrees(edge(6, 2), start));
  EXPECT_TRUE(agrees(edge(6, 5), old));
  EXPECT_FALSE(agrees(edge(6, 5), start));
  EXPECT_TRUE(agrees(edge(7, 6), old));
  EXPECT_TRUE(agrees(edge(3, 2), old));
}

TEST_F(EssentialGraph, LinksNeedHundredSharedPoints) {
  group.links = {{kf(7), kf(0)}, {kf(7), kf(1)}, {kf(6), kf(2)}};
  group.shared[0] = {{kf(0), 100}, {kf(1), 3}, {kf(6), 20}};
  group.shared[1] = {{kf(2), 99}, {kf(5), 20}, {kf(7), 20}};
  build();
  EXPECT_THAT(pairs(), ::testing::UnorderedElementsAreArray(with_tree({{7, 1}, {7, 0}})));
}

// OD-108: one edge per pair.
TEST_F(EssentialGraph, StrongCovisibilityCountsOncePerPair) {
  share(100, 2, 4);
  share(99, 3, 5);
  share(100, 4, 5);  // parent and child
  build();
  EXPECT_THAT(pairs(), ::testing::UnorderedElementsAreArray(with_tree({{7, 1}, {4, 2}})));
}

TEST_F(EssentialGraph, TheGroupsCovisibilityIsThatWithTheFusions) {
  share(100, 4, 6);  // as the map says; the fusions leave less
  share(20, 3, 7);
  group.shared[0] = {{kf(3), 120}, {kf(6), 20}};
  group.shared[1] = {{kf(4), 90}, {kf(5), 20}, {kf(7), 20}};
  build();
  EXPECT_THAT(pairs(), ::testing::UnorderedElementsAreArray(with_tree({{7, 1}, {7, 3}})));
}

// OD-108: one edge per pair.
TEST_F(EssentialGraph, CovisibleMembersOfTheGroupGetOneEdge) {
  group.keyframes = kfs({7, 6, 5});
  group.corrected.push_back(Similarity(builder.map.T_cw(kf(5))) * kShift);
  group.shared = {
      {{kf(5), 150}, {kf(6), 150}}, {{kf(5), 150}, {kf(7), 150}}, {{kf(6), 150}, {kf(7), 150}}};
  build();
  EXPECT_THAT(pairs(), ::testing::UnorderedElementsAreArray(with_tree({{7, 1}, {7, 5}})));
}

TEST_F(EssentialGraph, EarlierLoopsStay) {
  builder.map.add_loop_edge(kf(0), kf(5));
  builder.map.add_loop_edge(kf(7), kf(1));  // the same two again
  build();
  EXPECT_THAT(pairs(), ::testing::UnorderedElementsAreArray(with_tree({{7, 1}, {5, 0}})));
}

// OD-108: no vertices are empty.
TEST_F(EssentialGraph, DeadAndUnpublishedKeyframesAreNoVertices) {
  const KeyFrameId waiting = builder.add_keyframe(false);
  ASSERT_TRUE(builder.erase_keyframe(kf(3)));
  build();
  EXPECT_EQ(correction.keyframes, kfs({0, 1, 2, 4, 5, 6, 7}));
  EXPECT_THAT(pairs(), ::testing::Contains(IdPair(4, 2)));  // the tree closes over the gap
  EXPECT_EQ(vertex_of(correction.keyframes, waiting), -1);
}

TEST_F(EssentialGraph, IsEmptyWithoutBothEnds) {
  ASSERT_TRUE(builder.erase_keyframe(kf(1)));
  build();
  EXPECT_THAT(correction.keyframes, IsEmpty());
  EXPECT_THAT(correction.graph.edges, IsEmpty());
}

TEST(Vertices, AreFoundByIds) {
  const auto keyframes = kfs({2, 3, 7});
  EXPECT_EQ(vertex_of(keyframes, kf(3)), 1);
  EXPECT_EQ(vertex_of(keyframes, kf(5)), -1);
  EXPECT_EQ(vertex_of(keyframes, kf(9)), -1);
  EXPECT_EQ(vertex_before(keyframes, kf(7)), 2U);
  EXPECT_EQ(vertex_before(keyframes, kf(6)), 1U);
  EXPECT_EQ(vertex_before(keyframes, kf(0)), 0U);
}

}  // namespace
}  // namespace orbslam
