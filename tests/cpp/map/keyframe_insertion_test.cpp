// SPDX-License-Identifier: BSD-3-Clause
#include "map/keyframe_insertion.hpp"

#include <gtest/gtest.h>

#include "base/errors.hpp"
#include "map_builder.hpp"

namespace orbslam::testing {
namespace {

/// n_close keypoints nearer than the limit of 4 m and n_far behind it, in mixed order.
TrackedFrame frame_with_depths(std::size_t n_close, std::size_t n_far) {
  std::vector<FeatureSpec> features;
  for (std::size_t i = 0; i < std::max(n_close, n_far); ++i) {
    FeatureSpec feature;
    feature.u = static_cast<float>(10 + i);
    feature.v = 100;
    feature.depth = 8 + 0.01F * static_cast<float>(i);
    if (i < n_far) features.push_back(feature);
    feature.depth = 1 + 0.01F * static_cast<float>(i);
    if (i < n_close) features.push_back(feature);
  }
  TrackedFrame frame(make_synthetic_frame(5, features));
  Vector6d xi;
  xi << 0.1, 0.2, -0.1, 1, -2, 0.5;
  frame.T_cw = Pose::exp(xi);
  return frame;
}

std::size_t n_created(std::size_t n_close, std::size_t n_far, std::size_t n_minimum = 100) {
  Map map;
  TrackedFrame frame = frame_with_depths(n_close, n_far);
  insert_keyframe(map, frame, true, n_minimum);
  EXPECT_EQ(map.n_points(), frame.n_associated());
  EXPECT_TRUE(check_invariants(map, false).empty());
  return map.n_points();
}

TEST(InsertKeyframe, CreatesAllClosePointsAndAtLeastTheMinimum) {
  EXPECT_EQ(n_created(150, 300), 151U);
  EXPECT_EQ(n_created(50, 300), 101U);
  EXPECT_EQ(n_created(0, 300), 101U);
  EXPECT_EQ(n_created(0, 60), 60U);
  EXPECT_EQ(n_created(150, 300, SIZE_MAX), 450U);
  EXPECT_EQ(n_created(0, 0), 0U);
}

TEST(InsertKeyframe, TakesTheNearestAndPutsThemWhereTheyAreMeasured) {
  Map map;
  TrackedFrame frame = frame_with_depths(20, 300);
  const KeyFrameId id = insert_keyframe(map, frame, true);
  EXPECT_EQ(frame.reference_keyframe(), id);
  EXPECT_FALSE(map.find(id)->published);
  float farthest = 0, nearest_left = 100;
  for (std::size_t i = 0; i < frame.frame->size(); ++i) {
    const float depth = frame.frame->depth[i];
    const MapPoint* point = map.find(frame.map_points[i]);
    if (!point) {
      nearest_left = std::min(nearest_left, depth);
      continue;
    }
    farthest = std::max(farthest, depth);
    EXPECT_TRUE((*frame.T_cw * point->position).isApprox(frame.frame->unproject(i), 1e-9));
    EXPECT_EQ(frame.positions[i], point->position);
    EXPECT_EQ(point->observation_count, 2);
    EXPECT_EQ(point->first_keyframe, id);
    EXPECT_EQ(point->first_frame, 5);
    EXPECT_EQ(map.find(id)->map_points[i], point->id);
  }
  EXPECT_LT(farthest, nearest_left);
}

TEST(InsertKeyframe, MatchedKeypointsCountButGetNoNewPoint) {
  MapBuilder builder;
  builder.add_keyframes(3);
  const MapPointId old_point = builder.add_point(kfs({0, 1, 2}));
  TrackedFrame frame = frame_with_depths(150, 300);
  frame.associate(1, old_point, {0, 0, 5});  // keypoint 1 is the nearest
  const KeyFrameId id = insert_keyframe(builder.map, frame, true);
  EXPECT_EQ(builder.map.n_points(), 1U + 150U);
  EXPECT_EQ(builder.map.find(id)->map_points[1], old_point);
  EXPECT_EQ(builder.map.find(old_point)->observation_count, 3) << "mapping adds it later";
  EXPECT_EQ(builder.violations(), "");
}

TEST(InsertKeyframe, OutliersGoIntoTheKeyframeAndDeadPointsDoNot) {
  MapBuilder builder;
  builder.add_keyframes(3);
  const auto points = builder.add_points(4, kfs({0, 1, 2}));
  TrackedFrame frame = frame_seeing(builder.map, points);
  frame.outlier[0] = 1;
  builder.map.erase_point(points[1]);
  builder.map.replace_point(points[2], points[3]);
  const KeyFrameId id = insert_keyframe(builder.map, frame, false);
  EXPECT_EQ(builder.map.find(id)->map_points[0], points[0]);
  EXPECT_FALSE(builder.map.find(id)->map_points[1].valid());
  EXPECT_FALSE(frame.map_points[1].valid());
  EXPECT_EQ(builder.map.find(id)->map_points[2], points[3]);
  EXPECT_EQ(frame.outlier[0], 1);
}

TEST(InsertKeyframe, NeedsAPose) {
  Map map;
  TrackedFrame frame(make_raster_frame(0, 4));
  EXPECT_THROW(insert_keyframe(map, frame, false), StateError);
  EXPECT_TRUE(map.keyframe_ids().empty());
}

TEST(ProcessNewKeyframe, AddsObservationsConnectsAndPublishes) {
  MapBuilder builder;
  builder.add_keyframes(2);
  const auto points = builder.add_points(20, kfs({0, 1}));
  TrackedFrame frame = frame_seeing(builder.map, points);
  const KeyFrameId id = insert_keyframe(builder.map, frame, false);
  std::vector<MapPointId> recent;
  process_new_keyframe(builder.map, id, recent);
  EXPECT_TRUE(recent.empty());
  const KeyFrame& keyframe = *builder.map.find(id);
  EXPECT_TRUE(keyframe.published);
  EXPECT_EQ(keyframe.neighbours, kfs({0, 1}));
  EXPECT_EQ(keyframe.parent, kf(0));
  for (const MapPointId point : points) EXPECT_EQ(builder.map.find(point)->observation_count, 3);
  EXPECT_EQ(builder.violations(), "");
  EXPECT_THROW(process_new_keyframe(builder.map, id, recent), StateError);
  EXPECT_THROW(process_new_keyframe(builder.map, kf(9), recent), StateError);
}

TEST(ProcessNewKeyframe, PointsCreatedWithItGoOnProbation) {
  MapBuilder builder;
  builder.add_keyframes(2);
  TrackedFrame frame = frame_with_depths(150, 0);
  const KeyFrameId id = insert_keyframe(builder.map, frame, true);
  std::vector<MapPointId> recent{MapPointId(1234)};
  process_new_keyframe(builder.map, id, recent);
  EXPECT_EQ(recent.size(), 151U);
  EXPECT_EQ(recent.front(), MapPointId(1234));
  EXPECT_EQ(builder.violations(), "");
}

TEST(ProcessNewKeyframe, FollowsWhatHappenedToItsMatchesMeanwhile) {
  MapBuilder builder;
  builder.add_keyframes(2);
  const auto points = builder.add_points(6, kfs({0, 1}));
  TrackedFrame frame = frame_seeing(builder.map, points);
  const KeyFrameId id = insert_keyframe(builder.map, frame, false);
  const MapPointId newcomer = builder.add_point(kfs({0, 1}));
  builder.map.erase_point(points[0]);               // slot 0: died
  builder.map.replace_point(points[1], newcomer);   // slot 1: has a successor
  builder.map.replace_point(points[2], points[3]);  // slots 2 and 3: became one point
  builder.map.replace_point(points[4], points[5]);  // slot 4: its successor died
  builder.map.erase_point(points[5]);
  EXPECT_EQ(builder.violations(), "");
  std::vector<MapPointId> recent;
  process_new_keyframe(builder.map, id, recent);
  const auto& slots = builder.map.find(id)->map_points;
  EXPECT_FALSE(slots[0].valid());
  EXPECT_EQ(slots[1], newcomer);
  EXPECT_EQ(slots[2], points[3]);
  EXPECT_FALSE(slots[3].valid());
  EXPECT_FALSE(slots[4].valid());
  EXPECT_FALSE(slots[5].valid());
  EXPECT_EQ(builder.violations(), "");
}

TEST(CountTrackedPoints, ByWeightedObservations) {
  MapBuilder builder;
  builder.add_keyframes(3);
  builder.add_points(2, kfs({0}));
  builder.add_points(3, kfs({0, 1}));
  builder.add_points(4, kfs({0, 1, 2}));
  EXPECT_EQ(count_tracked_points(builder.map, kf(0), 0), 9);
  EXPECT_EQ(count_tracked_points(builder.map, kf(0), 2), 7);
  EXPECT_EQ(count_tracked_points(builder.map, kf(0), 3), 4);
  EXPECT_EQ(count_tracked_points(builder.map, kf(1), 3), 4);
  EXPECT_EQ(count_tracked_points(builder.map, kf(7), 3), 0);
}

}  // namespace
}  // namespace orbslam::testing
