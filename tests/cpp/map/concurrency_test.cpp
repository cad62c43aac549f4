// SPDX-License-Identifier: BSD-3-Clause
// One writer as the mapper, readers as the tracker and a viewer: for the thread sanitizer, and for
// views that must never be half of a change.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <thread>

#include "map/content_hash.hpp"
#include "map/culling.hpp"
#include "map/keyframe_insertion.hpp"
#include "map/local_map.hpp"
#include "map/sightings.hpp"
#include "map/snapshot.hpp"
#include "map/trajectory.hpp"
#include "map_builder.hpp"

namespace orbslam::testing {
namespace {

// OD-94: nobody sees the small steps of mapping.
TEST(Concurrency, ReadersSeeConsistentMapsWhileAWriterWorks) {
  const PointCloud cloud = make_point_cloud(150, 2, 3, 6, 1);
  Map map;
  std::vector<MapPointId> recent;
  std::atomic<bool> done{false};
  std::atomic<int> n_views{0};

  const auto insert = [&](int k) {
    const Pose T_cw(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-0.01 * k, 0, 0));
    TrackedFrame frame(project_cloud(k, cloud, T_cw).frame);
    frame.T_cw = T_cw;
    // The cloud is in view of every keyframe, in the same order: slot i is the same point.
    if (k > 0) {
      const auto ids = [&] {
        const auto lock = map.read_lock();
        return map.point_ids();
      }();
      for (std::size_t i = 0; i < std::min(ids.size(), frame.map_points.size()); ++i) {
        frame.associate(i, ids[i], Eigen::Vector3d::Zero());
      }
    }
    process_new_keyframe(map, insert_keyframe(map, frame, true), recent);
  };
  insert(0);

  std::thread tracker([&] {
    const std::vector<MapPointId> seen = snapshot_map(map).points.ids;
    TrajectoryRecorder recorder;
    while (!done) {
      TrackedFrame frame(make_raster_frame(0, seen.size()));
      frame.T_cw = Pose();
      for (std::size_t i = 0; i < seen.size(); ++i) frame.associate(i, seen[i], {0, 0, 0});
      const LocalMap local = select_local_map(map, frame);
      if (!local.reference_keyframe.valid()) continue;
      recorder.record(map, frame, false);
      EXPECT_EQ(gather_points(map, {MapPointId()}).size(), 0U);
      ++n_views;
    }
    EXPECT_EQ(recorder.rebuild(map).T_wc.size(), recorder.size());
  });
  std::thread viewer([&] {
    while (!done) {
      EXPECT_TRUE(check_invariants(map, false).empty());
      EXPECT_GE(snapshot_keyframes(map).ids.size(), 1U);
      content_hash(map);
      snapshot_edges(map);
      ++n_views;
    }
  });
  for (int k = 1; k < 40 || n_views < 20; ++k) {
    insert(k);
    const KeyFrameId current(k);
    cull_recent_points(map, current, 3, recent);
    cull_keyframes(map, current, true);
    const auto lock = map.write_lock();
    map.set_pose(current, Pose());
  }
  done = true;
  tracker.join();
  viewer.join();
  EXPECT_TRUE(check_invariants(map, false).empty());
}

// Tracking counts at every image, and the map may be copied for tens of milliseconds.
TEST(Concurrency, SightingsAreCountedWhileOthersRead) {
  const PointCloud cloud = make_point_cloud(150, 2, 3, 6, 1);
  Map map;
  TrackedFrame frame(project_cloud(0, cloud, Pose()).frame);
  frame.T_cw = Pose();
  insert_keyframe(map, frame, true);
  const std::vector<MapPointId> seen = snapshot_map(map).points.ids;
  constexpr int kTimes = 100;
  const auto count = [&] {
    for (int i = 0; i < kTimes; ++i) count_sightings(map, frame, seen);
  };

  auto reading = map.read_lock();
  auto first = std::async(std::launch::async, count);
  auto second = std::async(std::launch::async, count);
  // Well before the test's time is up, so that a counter which waits fails instead of hanging.
  EXPECT_EQ(first.wait_for(std::chrono::seconds(20)), std::future_status::ready);
  EXPECT_EQ(second.wait_for(std::chrono::seconds(20)), std::future_status::ready);
  reading.unlock();
  first.get();
  second.get();

  ASSERT_FALSE(seen.empty());
  const auto lock = map.read_lock();
  for (const MapPointId id : seen) {
    EXPECT_EQ(map.find(id)->n_visible.value(), 1 + 2 * kTimes);
    EXPECT_EQ(map.find(id)->n_found.value(), 1 + 2 * kTimes);
  }
}

}  // namespace
}  // namespace orbslam::testing
