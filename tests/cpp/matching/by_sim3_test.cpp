// SPDX-License-Identifier: BSD-3-Clause
#include "matching/by_sim3.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <stdexcept>

#include "matching/scenes.hpp"

namespace orbslam {
namespace {

using namespace testing;

/// Two keyframes that see the same things and know nothing of each other: all that `b` saw is in
/// the map a second time, in a part that has drifted to another scale.
struct LoopScene : Scene {
  LoopScene(double drift, const ProjectionOptions& options = {},
            std::shared_ptr<const Camera> camera_b = synthetic_camera())
      : Scene(300, 11) {
    std::mt19937_64 random(5);
    const Pose T_aw = small_motion(random, 0.03, 0.15), T_bw = small_motion(random, 0.03, 0.15);
    a = add_keyframe(T_aw, options);
    observe_all(a);
    projected.push_back(project_cloud(1, cloud, T_bw, options, std::move(camera_b)));
    put_under_nodes(*projected[1].frame, [](std::size_t) { return 1U; });
    b = map.add_keyframe(projected[1].frame, Pose(T_bw.rotation(), drift * T_bw.translation()));
    map.publish(b);
    points_of_b.resize(cloud.positions.size());
    for (std::size_t i = 0; i < projected[1].points.size(); ++i) {
      const std::size_t k = projected[1].points[i];
      points_of_b[k] = map.add_point(drift * cloud.positions[k], b, 0);
      map.add_observation(points_of_b[k], b, i);
      map.update_point(points_of_b[k]);
    }
    S_ab = Similarity(T_aw * T_bw.inverse()) *
           Similarity(1 / drift, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero());
    // The corrected place of `a`: where the part of the map around `b` says it is.
    S_aw = S_ab * Similarity(map.find(b)->T_cw);
    matches.resize(projected[0].points.size());
  }

  /// The point of `b` that shows what keypoint i of `a` shows, or an invalid id.
  MapPointId partner(std::size_t i) const { return points_of_b[projected[0].points[i]]; }
  int n_common() const {
    int n = 0;
    for (std::size_t i = 0; i < matches.size(); ++i) n += partner(i).valid() ? 1 : 0;
    return n;
  }
  void expect_right_matches() const {
    for (std::size_t i = 0; i < matches.size(); ++i) {
      if (!matches[i].valid()) continue;
      EXPECT_EQ(matches[i], partner(i)) << i;
    }
  }
  std::vector<MapPointId> loop_points() const {
    std::vector<MapPointId> ids;
    std::copy_if(points_of_b.begin(), points_of_b.end(), std::back_inserter(ids),
                 [](MapPointId id) { return id.valid(); });
    return ids;
  }

  KeyFrameId a, b;
  Similarity S_ab, S_aw;
  std::vector<MapPointId> points_of_b, matches;
};

// OD-103: distances are compared in the units of the point's own side.
TEST(MatchBySimilarity, FindsWhatBothSeeWhateverTheScale) {
  for (const double drift : {0.4, 1.0, 2.5}) {
    LoopScene scene(drift);
    const int n = match_by_similarity(scene.map, scene.a, scene.b, scene.S_ab, scene.matches);
    EXPECT_EQ(n, scene.n_common()) << drift;
    EXPECT_GT(n, 100);
    scene.expect_right_matches();
  }
}

TEST(MatchBySimilarity, KeepsAndDoesNotRepeatMatches) {
  LoopScene scene(1.3);
  std::size_t given = 0;
  while (!scene.partner(given).valid()) ++given;
  scene.matches[given] = scene.partner(given);
  EXPECT_EQ(match_by_similarity(scene.map, scene.a, scene.b, scene.S_ab, scene.matches),
            scene.n_common() - 1);
  scene.expect_right_matches();
  // The keypoint of `b` is taken, so its point is not searched for from there.
  LoopScene wrong(1.3);
  std::size_t other = given + 1;
  while (!wrong.partner(other).valid()) ++other;
  wrong.matches[given] = wrong.partner(other);
  match_by_similarity(wrong.map, wrong.a, wrong.b, wrong.S_ab, wrong.matches);
  EXPECT_EQ(wrong.matches[given], wrong.partner(other));
  EXPECT_FALSE(wrong.matches[other].valid());
  EXPECT_EQ(match_by_similarity(wrong.map, wrong.a, wrong.b, wrong.S_ab, wrong.matches), 0);
}

// OD-103: not one keyframe's calibration for both images.
TEST(MatchBySimilarity, UsesEachKeyframesOwnCamera) {
  CameraOptions options;
  options.pinhole = {300, 310, 330, 230};
  options.image_size = {640, 480};
  LoopScene scene(1, {}, std::make_shared<Camera>(options));
  EXPECT_EQ(match_by_similarity(scene.map, scene.a, scene.b, scene.S_ab, scene.matches),
            scene.n_common());
  scene.expect_right_matches();
}

TEST(MatchBySimilarity, WrongSimilaritiesAndPointsBehindFindNothing) {
  LoopScene scene(1);
  const Similarity turned(1, Eigen::Quaterniond(0, 0, 1, 0), Eigen::Vector3d::Zero());
  EXPECT_EQ(match_by_similarity(scene.map, scene.a, scene.b, turned, scene.matches), 0);
  Vector7d aside = Vector7d::Zero();
  aside(1) = 0.3;  // about 120 pixels
  const Similarity wrong = Similarity::exp(aside) * scene.S_ab;
  EXPECT_EQ(match_by_similarity(scene.map, scene.a, scene.b, wrong, scene.matches), 0);
}

TEST(MatchBySimilarity, DeadKeyframesAndBadSizes) {
  LoopScene scene(1);
  EXPECT_EQ(match_by_similarity(scene.map, scene.a, KeyFrameId(7), scene.S_ab, scene.matches), 0);
  scene.matches.pop_back();
  EXPECT_THROW(match_by_similarity(scene.map, scene.a, scene.b, scene.S_ab, scene.matches),
               std::invalid_argument);
}

TEST(MatchLoopPoints, FindsThePointsAtTheCorrectedPlace) {
  for (const double drift : {0.4, 1.0, 2.5}) {
    ProjectionOptions options;
    options.pixel_noise = 2;
    options.flipped_bits = 20;
    LoopScene scene(drift, options);
    const int n =
        match_loop_points(scene.map, scene.a, scene.S_aw, scene.loop_points(), scene.matches);
    EXPECT_EQ(n, scene.n_common()) << drift;
    scene.expect_right_matches();
    EXPECT_EQ(match_loop_points(scene.map, scene.a, scene.S_aw, scene.loop_points(), scene.matches),
              0);  // all are matched
  }
}

TEST(MatchLoopPoints, OccupiedKeypointsAreNotTaken) {
  LoopScene scene(1);
  std::size_t given = 0;
  while (!scene.partner(given).valid()) ++given;
  const MapPointId other(123456);
  scene.matches[given] = other;
  EXPECT_EQ(match_loop_points(scene.map, scene.a, scene.S_aw, scene.loop_points(), scene.matches),
            scene.n_common() - 1);
  EXPECT_EQ(scene.matches[given], other);
}

TEST(MatchLoopPoints, DescriptorsMayDifferInFiftyBits) {
  for (const int bits : {50, 51}) {
    ProjectionOptions options;
    LoopScene scene(1, options);
    // A feature of `a` at the place of a point of `b`, as different as is asked for.
    std::mt19937_64 random(3);
    Frame& frame = *scene.projected[0].frame;
    for (std::size_t i = 0; i < frame.size(); ++i) {
      frame.descriptors[i] =
          flip_bits(scene.cloud.descriptors[scene.projected[0].points[i]], bits, random);
    }
    const int n =
        match_loop_points(scene.map, scene.a, scene.S_aw, scene.loop_points(), scene.matches);
    EXPECT_EQ(n, bits == 50 ? scene.n_common() : 0);
  }
}

TEST(MatchLoopPoints, PointsSeenFromTheOtherSideAreLeftOut) {
  LoopScene scene(1);
  const Similarity turned(1, Eigen::Quaterniond(0, 0, 1, 0), Eigen::Vector3d(0, 0, 14));
  EXPECT_EQ(match_loop_points(scene.map, scene.a, turned, scene.loop_points(), scene.matches), 0);
}

TEST(MatchLoopPoints, DeadKeyframesAndBadSizes) {
  LoopScene scene(1);
  EXPECT_EQ(match_loop_points(scene.map, KeyFrameId(9), scene.S_aw, {}, scene.matches), 0);
  scene.matches.pop_back();
  EXPECT_THROW(match_loop_points(scene.map, scene.a, scene.S_aw, {}, scene.matches),
               std::invalid_argument);
}

TEST(FindLoopFusions, FindsThePointsWhateverTheKeypointsHold) {
  for (const double drift : {0.4, 1.0, 2.5}) {
    LoopScene scene(drift);
    // Half of the keypoints that show a point of the loop are free.
    const std::vector<MapPointId> slots = scene.map.find(scene.a)->map_points;
    for (std::size_t i = 0; i < slots.size(); i += 2) scene.map.erase_point(slots[i]);
    const auto before = scene.map.structure_version();
    const auto found = find_loop_fusions(*scene.projected[0].frame, scene.S_aw,
                                         gather_points(scene.map, scene.loop_points()));
    EXPECT_EQ(static_cast<int>(found.size()), scene.n_common());
    for (const PointSighting& sighting : found) {
      EXPECT_EQ(sighting.point, scene.partner(sighting.keypoint));
    }
    EXPECT_EQ(scene.map.structure_version(), before);
  }
}

TEST(FindLoopFusions, RadiusIsFourTimesTheScale) {
  for (const float aside : {3.9F, 4.1F}) {
    LoopScene scene(1);
    Frame& frame = *scene.projected[0].frame;
    for (Keypoint& keypoint : frame.keypoints) keypoint.x += aside;
    frame.grid = KeypointGrid(frame.keypoints, frame.camera->bounds());
    PointBatch points = gather_points(scene.map, scene.loop_points());
    for (std::size_t i = 0; i < points.size(); ++i) {  // seen at level 0 from where `a` stands
      points.max_distances[i] = (points.positions[i] - scene.S_aw.pose().center()).norm();
      points.min_distances[i] = 0;
    }
    const auto found = find_loop_fusions(frame, scene.S_aw, points);
    if (aside > 4) {
      EXPECT_TRUE(found.empty());
    } else {
      EXPECT_GT(static_cast<int>(found.size()), scene.n_common() * 9 / 10);
    }
  }
}

TEST(FindLoopFusions, SeveralPointsMayFindTheSameKeypoint) {
  LoopScene scene(1);
  PointBatch points = gather_points(scene.map, scene.loop_points());
  const auto once = find_loop_fusions(*scene.projected[0].frame, scene.S_aw, points);
  const PointBatch again = points;
  for (std::size_t i = 0; i < again.size(); ++i) {
    points.ids.push_back(again.ids[i]);
    points.positions.push_back(again.positions[i]);
    points.mean_directions.push_back(again.mean_directions[i]);
    points.min_distances.push_back(again.min_distances[i]);
    points.max_distances.push_back(again.max_distances[i]);
    points.descriptors.push_back(again.descriptors[i]);
  }
  const auto twice = find_loop_fusions(*scene.projected[0].frame, scene.S_aw, points);
  ASSERT_EQ(twice.size(), 2 * once.size());
  for (std::size_t i = 0; i < once.size(); ++i) {
    EXPECT_EQ(twice[i].point, once[i].point);
    EXPECT_EQ(twice[i + once.size()].keypoint, once[i].keypoint);
  }
}

}  // namespace
}  // namespace orbslam
