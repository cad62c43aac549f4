// SPDX-License-Identifier: BSD-3-Clause
#include "loops/fusion_draft.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "map/map_builder.hpp"

namespace orbslam {
namespace {

using namespace testing;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

TEST(NeighboursBy, AreStrongOrTheBest) {
  EXPECT_THAT(neighbours_by({{kf(1), 14}, {kf(2), 15}, {kf(4), 30}, {kf(7), 30}}),
              ElementsAre(kf(4), kf(7), kf(2)));
  EXPECT_THAT(neighbours_by({{kf(1), 3}, {kf(2), 9}, {kf(3), 9}}), ElementsAre(kf(2)));
  EXPECT_THAT(neighbours_by({}), IsEmpty());
}

/// Keyframes 0, 1 on the far side and 2, 3 in the group; one point of each side.
class Draft : public ::testing::Test {
 protected:
  void SetUp() override {
    builder.add_keyframes(4);
    far = builder.add_point(kfs({0, 1}));
    near = builder.add_point(kfs({2, 3}));
  }
  FusionDraft draft(const std::vector<MapPointId>& far_points) {
    return FusionDraft(builder.map, kfs({2, 3}), far_points);
  }
  std::uint32_t slot_of(MapPointId point, std::int64_t keyframe) {
    return builder.map.find(point)->observation_of(kf(keyframe))->index;
  }
  MapBuilder builder;
  MapPointId far, near;
};

TEST_F(Draft, FreeKeypointsGainThePoint) {
  FusionDraft drafted = draft({far});
  drafted.fuse(1, 100, far);
  EXPECT_THAT(drafted.shared_points()[1],
              ElementsAre(Pair(kf(0), 1), Pair(kf(1), 1), Pair(kf(2), 1)));
  EXPECT_THAT(drafted.shared_points()[0], ElementsAre(Pair(kf(3), 1)));
  const auto fusions = drafted.take_fusions();
  ASSERT_EQ(fusions.size(), 1U);
  EXPECT_EQ(fusions[0].point, far);
  EXPECT_FALSE(fusions[0].replaced.valid());
  EXPECT_EQ(fusions[0].keyframe, kf(3));
  EXPECT_EQ(fusions[0].keypoint, 100U);
}

TEST_F(Draft, ThePointOfTheFarSideTakesThePlaceInAllKeyframes) {
  FusionDraft drafted = draft({far});
  drafted.fuse(0, slot_of(near, 2), far);
  drafted.fuse(1, 100, far);  // keyframe 3 sees it already, at the place of the other
  const auto shared = drafted.shared_points();
  EXPECT_THAT(shared[0], ElementsAre(Pair(kf(0), 1), Pair(kf(1), 1), Pair(kf(3), 1)));
  EXPECT_THAT(shared[1], ElementsAre(Pair(kf(0), 1), Pair(kf(1), 1), Pair(kf(2), 1)));
  const auto fusions = drafted.take_fusions();
  ASSERT_EQ(fusions.size(), 1U);
  EXPECT_EQ(fusions[0].replaced, near);
  EXPECT_EQ(builder.map.resolve(near), near);  // the map stays as it is
}

TEST_F(Draft, PointsThatOneKeyframeTellsApartStayTwo) {
  const MapPointId other = builder.add_point(kfs({0, 1}));
  const MapPointId elsewhere = builder.add_point(kfs({1}));
  const MapPointId unrelated = builder.map.add_point({0, 0, 5}, kf(0), 0);
  builder.map.add_observation(unrelated, kf(0), 300);
  FusionDraft drafted = draft({far, other, elsewhere, unrelated});
  drafted.fuse(0, 50, far);
  drafted.fuse(0, 50, other);
  EXPECT_EQ(drafted.shared_points()[0].front(), std::make_pair(kf(0), 1));
  drafted.fuse(1, 51, elsewhere);
  drafted.fuse(1, 51, unrelated);  // nobody has seen both
  const auto fusions = drafted.take_fusions();
  ASSERT_EQ(fusions.size(), 3U);
  EXPECT_EQ(fusions[2].point, unrelated);
  EXPECT_EQ(fusions[2].replaced, elsewhere);
}

TEST_F(Draft, OnThisSideAKeyframeMaySeeBoth) {
  FusionDraft drafted = draft({far});
  drafted.fuse(0, 100, far);  // beside the one it has
  drafted.fuse(1, slot_of(near, 3), far);
  EXPECT_EQ(drafted.shared_points()[0].size(), 3U);
  drafted.fuse(0, slot_of(near, 2), far);  // is free now, but the point is there already
  const auto fusions = drafted.take_fusions();
  ASSERT_EQ(fusions.size(), 2U);
  EXPECT_EQ(fusions[1].replaced, near);
}

TEST_F(Draft, ReplacedPointsOfTheFarSideAreFollowed) {
  const MapPointId elsewhere = builder.add_point(kfs({1}));
  const MapPointId unrelated = builder.map.add_point({0, 0, 5}, kf(0), 0);
  builder.map.add_observation(unrelated, kf(0), 300);
  FusionDraft drafted = draft({elsewhere, unrelated});
  drafted.fuse(1, 51, elsewhere);
  drafted.fuse(1, 51, unrelated);
  drafted.fuse(0, 52, elsewhere);
  EXPECT_EQ(drafted.take_fusions().back().point, unrelated);
}

TEST_F(Draft, DeadAndUnknownPointsAreLeftAlone) {
  const MapPointId dead = builder.add_point(kfs({0}));
  builder.map.erase_point(dead);
  FusionDraft drafted = draft({dead, far, far, MapPointId()});
  EXPECT_EQ(drafted.far_points().size(), 1U);
  drafted.fuse(0, 50, dead);
  drafted.fuse(0, 50, MapPointId());
  EXPECT_THAT(drafted.take_fusions(), IsEmpty());
}

// OD-107: in a stated order, not in that of addresses.
TEST_F(Draft, PointsAreCarriedByTheFirstThatSeesThem) {
  const MapPointId both = builder.add_point(kfs({1, 3}));  // of the far side, seen from the group
  const MapPointId adopted = builder.add_point(kfs({3, 0}));  // the same, made by the group
  const MapPointId unknown = builder.add_point(kfs({0, 1}));
  const FusionDraft drafted(builder.map, kfs({3, 2}), {far, both, adopted});
  EXPECT_EQ(drafted.carrier(near), kf(3));
  EXPECT_EQ(drafted.carrier(far), kf(0));
  EXPECT_EQ(drafted.carrier(both), kf(1));
  EXPECT_EQ(drafted.carrier(adopted), kf(0));
  EXPECT_FALSE(drafted.carrier(unknown).valid());
  const FusionDraft without(builder.map, kfs({3, 2}), {});
  EXPECT_EQ(without.carrier(both), kf(3));
}

/// What the draft says will be is what becomes of the map when the fusions are carried out.
TEST(FusionDraft, ForetellsTheMap) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    std::mt19937_64 random(seed);
    MapBuilder builder;
    builder.add_keyframes(12);
    std::vector<MapPointId> far;
    for (int i = 0; i < 150; ++i) {
      std::vector<KeyFrameId> observers;
      const bool is_far = i < 60;
      for (std::int64_t k = is_far ? 0 : 5; k < (is_far ? 7 : 12); ++k) {
        if (uniform(random) < 0.4) observers.push_back(kf(k));
      }
      if (observers.empty()) observers.push_back(kf(is_far ? 0 : 11));
      const MapPointId point = builder.add_point(observers);
      if (is_far) far.push_back(point);
    }
    const std::vector<KeyFrameId> group = kfs({11, 8, 9, 6});
    FusionDraft drafted(builder.map, group, far);
    for (int i = 0; i < 300; ++i) {
      drafted.fuse(uniform_index(random, group.size()),
                   static_cast<std::uint32_t>(uniform_index(random, 80)),
                   far[uniform_index(random, far.size())]);
    }
    const auto shared = drafted.shared_points();
    int n_replaced = 0;
    for (const LoopCorrection::Fusion& fusion : drafted.take_fusions()) {
      if (fusion.replaced.valid()) {
        ASSERT_EQ(builder.map.resolve(fusion.replaced), fusion.replaced);
        builder.map.replace_point(fusion.replaced, fusion.point);
        ++n_replaced;
      } else {
        const int before = builder.map.find(fusion.point)->observation_count;
        builder.map.add_observation(fusion.point, fusion.keyframe, fusion.keypoint);
        ASSERT_GT(builder.map.find(fusion.point)->observation_count, before);
      }
    }
    EXPECT_GT(n_replaced, 20);
    for (std::size_t k = 0; k < group.size(); ++k) {
      builder.map.update_connections(group[k]);
      const auto& weights = builder.map.find(group[k])->weights;
      EXPECT_EQ(shared[k], SharedPoints(weights.begin(), weights.end())) << seed;
      EXPECT_EQ(neighbours_by(shared[k]), builder.map.find(group[k])->neighbours) << seed;
    }
    EXPECT_EQ(builder.violations(), "");
  }
}

}  // namespace
}  // namespace orbslam
