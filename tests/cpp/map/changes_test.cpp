// SPDX-License-Identifier: BSD-3-Clause
#include "map/changes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <memory>
#include <thread>

#include "map_mirror.hpp"
#include "random_operations.hpp"

namespace orbslam::testing {
namespace {

using Ids = std::vector<std::int64_t>;

template <class Tag>
Ids values(const std::vector<Id<Tag>>& ids) {
  Ids numbers;
  for (const Id<Tag> id : ids) numbers.push_back(id.value);
  return numbers;
}

/// Three keyframes, and points 0 to 19 that the last two see; all of it told.
struct Followed : MapBuilder {
  static constexpr int kLeastWeight = 15;
  MapFollower follower{borrowed(map), kLeastWeight};
  MapMirror mirror;

  Followed() {
    add_keyframes(3);
    add_points(20, kfs({1, 2}));
    map.update_connections(kf(2));
    look();
  }

  MapChanges look() {
    MapChanges changes = follower.update();
    mirror.apply(changes);
    EXPECT_EQ(mirror.differences(map, kLeastWeight), "");
    return changes;
  }
  /// Ids of what one change of the map sets.
  Ids points_set_by(const std::function<void()>& change) {
    change();
    const MapChanges changes = look();
    EXPECT_TRUE(changes.keyframes_set.ids.empty());
    return values(changes.points_set.ids);
  }
  Ids keyframes_set_by(const std::function<void()>& change) {
    change();
    const MapChanges changes = look();
    EXPECT_TRUE(changes.points_set.ids.empty());
    return values(changes.keyframes_set.ids);
  }
};

TEST(MapFollower, TellsEverythingAtFirst) {
  MapBuilder builder;
  builder.add_keyframes(2);
  builder.add_points(20, kfs({0, 1}));
  builder.map.update_connections(kf(1));
  builder.add_keyframe(false);
  builder.map.erase_point(MapPointId(5));
  MapFollower follower(borrowed(builder.map), 15);
  const MapChanges changes = follower.update();
  EXPECT_TRUE(changes.restarted);
  EXPECT_EQ(changes.map, 0);
  EXPECT_EQ(values(changes.keyframes_set.ids), (Ids{0, 1}));
  EXPECT_EQ(changes.keyframes_set.T_wc[1][3], 1.0);
  EXPECT_EQ(changes.keyframes_set.timestamps[1], 1.0 / 30);
  EXPECT_EQ(changes.keyframes_set.parents[1], kf(0));
  EXPECT_EQ(changes.points_set.ids.size(), 19U);
  EXPECT_EQ(changes.points_set.positions[0], (std::array<double, 3>{0, 0, 5}));
  EXPECT_EQ(changes.points_set.observation_counts[0], 2);
  EXPECT_TRUE(changes.points_removed.empty());
  EXPECT_EQ(*changes.covisibility, (KeyFramePairs{{kf(0), kf(1)}}));
  EXPECT_EQ(*changes.spanning_tree, (KeyFramePairs{{kf(1), kf(0)}}));
  EXPECT_TRUE(changes.loop_edges->empty());
}

TEST(MapFollower, TellsNothingOfAMapThatStandsStill) {
  Followed followed;
  const MapChanges changes = followed.look();
  EXPECT_FALSE(changes.restarted);
  EXPECT_TRUE(changes.keyframes_set.ids.empty() && changes.points_set.ids.empty());
  EXPECT_TRUE(changes.keyframes_removed.empty() && changes.points_removed.empty());
  EXPECT_FALSE(changes.covisibility || changes.loop_edges || changes.spanning_tree);
}

TEST(MapFollower, TellsOfPointsThatWereChanged) {
  Followed followed;
  Map& map = followed.map;
  const MapPointId p(7);
  EXPECT_EQ(followed.points_set_by([&] { map.set_position(p, {1, 2, 3}); }), (Ids{7}));
  EXPECT_EQ(followed.points_set_by([&] { map.set_geometry(p, {}); }), (Ids{7}));
  EXPECT_EQ(followed.points_set_by([&] { map.update_descriptor(p); }), (Ids{7}));
  EXPECT_EQ(followed.points_set_by([&] { map.update_geometry(p); }), (Ids{7}));
  EXPECT_EQ(followed.points_set_by([&] { map.add_observation(p, kf(0), 90); }), (Ids{7}));
  EXPECT_EQ(followed.points_set_by([&] { map.erase_observation(p, kf(1)); }), (Ids{})) << "it died";
  EXPECT_EQ(followed.points_set_by([&] { map.add_point({0, 0, 1}, kf(0), 3); }), (Ids{20}));
  EXPECT_EQ(followed.points_set_by([&] { map.replace_point(MapPointId(3), MapPointId(4)); }),
            (Ids{4}));
}

TEST(MapFollower, TellsOfPointsThatDied) {
  Followed followed;
  followed.map.erase_point(MapPointId(2));
  followed.map.replace_point(MapPointId(3), MapPointId(4));
  followed.map.erase_observation(MapPointId(5), kf(1));
  EXPECT_EQ(values(followed.look().points_removed), (Ids{2, 3, 5}));
  for (const MapPointId id : followed.map.point_ids()) followed.map.erase_point(id);
  EXPECT_EQ(followed.look().points_removed.size(), 17U) << "the page is gone with them";
}

TEST(MapFollower, HearsOfDeathsInAPageThatWasGoneMeanwhile) {
  Followed followed;
  for (const MapPointId id : followed.map.point_ids()) followed.map.erase_point(id);
  const MapPointId added = followed.add_point(kfs({1, 2}));
  EXPECT_EQ(added.value, 20);
  const MapChanges changes = followed.look();
  EXPECT_EQ(changes.points_removed.size(), 20U);
  EXPECT_EQ(values(changes.points_set.ids), (Ids{20}));
}

TEST(MapFollower, NeverHearsOfWhatCameAndWentBetweenTwoLooks) {
  Followed followed;
  followed.map.erase_point(followed.add_point(kfs({1, 2})));
  followed.erase_keyframe(followed.add_keyframe());
  const MapChanges changes = followed.look();
  EXPECT_TRUE(changes.points_removed.empty() && changes.points_set.ids.empty());
  EXPECT_TRUE(changes.keyframes_removed.empty() && changes.keyframes_set.ids.empty());
}

TEST(MapFollower, DoesNotCountSightings) {
  Followed followed;
  EXPECT_EQ(followed.points_set_by([&] {
    followed.map.count_visible(MapPointId(1));
    followed.map.count_found(MapPointId(1));
  }),
            (Ids{}));
}

TEST(MapFollower, TellsOfKeyframesThatWereChanged) {
  Followed followed;
  Map& map = followed.map;
  EXPECT_EQ(followed.keyframes_set_by([&] { map.set_pose(kf(1), Pose()); }), (Ids{1}));
  EXPECT_EQ(followed.keyframes_set_by([&] { map.rescale(kf(1), 2); }), (Ids{1}));
  EXPECT_EQ(followed.keyframes_set_by([&] { map.mark_processed(kf(2)); }), (Ids{2}));
  EXPECT_EQ(followed.keyframes_set_by([&] { map.set_parent(kf(2), kf(0)); }), (Ids{2}));
  EXPECT_EQ(followed.keyframes_set_by([&] { map.add_loop_edge(kf(0), kf(2)); }), (Ids{0, 2}));
  EXPECT_EQ(followed.keyframes_set_by([&] { followed.add_keyframe(false); }), (Ids{}))
      << "not published";
  EXPECT_EQ(followed.keyframes_set_by([&] { map.publish(kf(3)); }), (Ids{3}));
  EXPECT_EQ(followed.keyframes_set_by([&] { followed.erase_keyframe(kf(3)); }), (Ids{}));
}

TEST(MapFollower, TellsOfEdgesWhenTheyChange) {
  Followed followed;
  Map& map = followed.map;
  map.set_pose(kf(1), Pose());
  MapChanges changes = followed.look();
  EXPECT_FALSE(changes.covisibility || changes.loop_edges || changes.spanning_tree);

  map.set_parent(kf(2), kf(0));
  changes = followed.look();
  EXPECT_EQ(*changes.spanning_tree, (KeyFramePairs{{kf(1), kf(0)}, {kf(2), kf(0)}}));
  EXPECT_FALSE(changes.covisibility || changes.loop_edges);

  map.add_loop_edge(kf(0), kf(2));
  changes = followed.look();
  EXPECT_EQ(*changes.loop_edges, (KeyFramePairs{{kf(0), kf(2)}}));
  EXPECT_FALSE(changes.covisibility || changes.spanning_tree);

  followed.add_points(14, kfs({0, 1}));
  map.update_connections(kf(0));
  EXPECT_FALSE(followed.look().covisibility) << "14 are too few";
  followed.add_points(1, kfs({0, 1}));
  map.update_connections(kf(0));
  changes = followed.look();
  EXPECT_EQ(*changes.covisibility, (KeyFramePairs{{kf(0), kf(1)}, {kf(1), kf(2)}}));
  EXPECT_FALSE(changes.loop_edges || changes.spanning_tree);

  EXPECT_TRUE(followed.erase_keyframe(kf(1)));
  changes = followed.look();
  EXPECT_EQ(values(changes.keyframes_removed), (Ids{1}));
  EXPECT_TRUE(changes.covisibility->empty());
}

TEST(MapFollower, EdgesLeadToPublishedKeyframesOnly) {
  Followed followed;
  followed.add_keyframe(false);
  followed.add_points(20, kfs({2, 3}));
  followed.map.update_connections(kf(3));
  EXPECT_FALSE(followed.look().covisibility);
  followed.map.publish(kf(3));
  EXPECT_EQ(*followed.look().covisibility, (KeyFramePairs{{kf(1), kf(2)}, {kf(2), kf(3)}}));
}

TEST(MapFollower, BeginsAnewWithEveryMap) {
  Followed followed;
  followed.map.clear();
  MapChanges changes = followed.look();
  EXPECT_TRUE(changes.restarted);
  EXPECT_EQ(changes.map, 1);
  EXPECT_TRUE(changes.covisibility && changes.covisibility->empty());
  EXPECT_FALSE(followed.look().restarted);
  followed.map.clear();
  followed.map.add_keyframe(make_raster_frame(0, 4), Pose());
  followed.map.publish(kf(0));
  changes = followed.look();
  EXPECT_TRUE(changes.restarted);
  EXPECT_EQ(values(changes.keyframes_set.ids), (Ids{0}));
}

class FollowedRandomly : public ::testing::TestWithParam<std::uint64_t> {};

TEST_P(FollowedRandomly, IsTheMapAfterAnyOperations) {
  RandomOperations operations(GetParam());
  std::mt19937_64 random(GetParam() + 100);
  // One looks after every operation, one now and then.
  MapFollower often(borrowed(operations.map()), 3), seldom(borrowed(operations.map()), 1);
  MapMirror mirror, other;
  for (int i = 0; i < 3000; ++i) {
    operations.perform();
    mirror.apply(often.update());
    ASSERT_EQ(mirror.differences(operations.map(), 3), "") << "operation " << i;
    if (uniform_index(random, 40) != 0) continue;
    other.apply(seldom.update());
    ASSERT_EQ(other.differences(operations.map(), 1), "") << "operation " << i;
  }
  EXPECT_GT(mirror.points.size(), 20U);
}

INSTANTIATE_TEST_SUITE_P(Seeds, FollowedRandomly, ::testing::Values(1, 2, 3, 4));

// The first look, and the one after everything has moved, take several sections, between which a
// writer changes what was looked at and what was not yet.
TEST(MapFollower, TellsOneMomentOfALargeMapThatIsBeingChanged) {
  constexpr std::int64_t kPoints = 20000;
  Map map;
  map.add_keyframe(make_raster_frame(0, 4), Pose());
  map.publish(kf(0));
  for (std::int64_t i = 0; i < kPoints; ++i) map.add_point({0, 0, 1}, kf(0), 0);

  // A hundred sections per look, at any moment of it.
  std::atomic<int> n_allowed{0};
  std::atomic<bool> done{false};
  std::thread writer([&] {
    std::int64_t oldest = 1;
    // In each section the first point, the last and the keyframe get the same number; one point
    // dies and one is born.
    for (int n = 1; !done; ++n) {
      while (n > n_allowed && !done) std::this_thread::yield();
      const auto lock = map.write_lock();
      const double x = n;
      map.set_position(MapPointId(0), {x, 0, 0});
      map.set_position(MapPointId(kPoints - 1), {x, 0, 0});
      map.set_pose(kf(0), Pose(Eigen::Quaterniond::Identity(), {-x, 0, 0}));
      map.erase_point(MapPointId(oldest));
      oldest += oldest == kPoints - 2 ? 2 : 1;
      const std::int64_t youngest = map.add_point({x, 0, 0}, kf(0), 0).value;
      if (n % 50 != 0) continue;
      for (std::int64_t i = oldest; i <= youngest; i += 100) {
        map.set_position(MapPointId(i), {x, 0, 0});
      }
    }
  });
  auto follower = std::make_unique<MapFollower>(borrowed(map));
  MapMirror mirror;
  for (int look = 0; look < 200; ++look) {
    if (look % 20 == 0) follower = std::make_unique<MapFollower>(borrowed(map));
    n_allowed += 100;
    const MapChanges changes = follower->update();
    mirror.apply(changes);
    const double first = mirror.points.at(MapPointId(0)).position[0];
    EXPECT_EQ(mirror.points.at(MapPointId(kPoints - 1)).position[0], first);
    EXPECT_EQ(mirror.keyframes.at(kf(0)).T_wc[3], first);
    EXPECT_EQ(mirror.points.size(), static_cast<std::size_t>(kPoints));
    const auto& ids = changes.points_set.ids;
    EXPECT_TRUE(std::adjacent_find(ids.begin(), ids.end(), std::greater_equal<>()) == ids.end())
        << "ascending, each once";
  }
  done = true;
  writer.join();
  mirror.apply(follower->update());
  EXPECT_EQ(mirror.differences(map, Map::kEssentialWeight), "");
}

}  // namespace
}  // namespace orbslam::testing
