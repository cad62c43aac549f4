// SPDX-License-Identifier: BSD-3-Clause
#include "matching/for_triangulation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "base/errors.hpp"
#include "geometry/triangulation.hpp"
#include "matching/scenes.hpp"

namespace orbslam {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;
using namespace testing;

using Pairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

FeatureSpec feature_at(float u, float v, int bits, std::int32_t level = 0, float depth = -1) {
  FeatureSpec spec = feature(level, bits, u, depth);
  spec.v = v;
  return spec;
}

struct TwoViews {
  TwoViews(const std::vector<FeatureSpec>& a, const std::vector<FeatureSpec>& b,
           const Pose& T_bw = at(1)) {
    ids[0] = add(a, Pose());
    ids[1] = add(b, T_bw);
  }
  KeyFrameId add(const std::vector<FeatureSpec>& features, const Pose& T_cw) {
    auto frame = make_synthetic_frame(0, features);
    put_under_one_node(*frame);
    const KeyFrameId id = map.add_keyframe(frame, T_cw);
    map.publish(id);
    return id;
  }
  Pairs match() const { return match_for_triangulation(map, ids[0], ids[1]); }

  Map map;
  KeyFrameId ids[2];
};

// The second camera is 1 m to the right: epipolar lines are the rows.
TEST(MatchForTriangulation, FeaturesMustLieNearTheEpipolarLine) {
  for (const std::int32_t level : {0, 3}) {
    const float limit = std::sqrt(3.84F) * synthetic_scales()->scale(level);
    const auto match = [&](float dv) {
      return TwoViews({feature_at(400, 200, 0)}, {feature_at(320, 200 + dv, 0, level)}).match();
    };
    EXPECT_THAT(match(limit - 0.01F), ElementsAre(Pair(0, 0)));
    EXPECT_THAT(match(limit + 0.01F), IsEmpty());
  }
}

TEST(MatchForTriangulation, LimitIsFiftyInclusiveAndTheLastOfEqualsWins) {
  const auto match = [](const std::vector<int>& bits) {
    std::vector<FeatureSpec> b;
    for (const int n : bits) b.push_back(feature_at(320, 200, n));
    return TwoViews({feature_at(400, 200, 0)}, b).match();
  };
  EXPECT_THAT(match({50}), ElementsAre(Pair(0, 0)));
  EXPECT_THAT(match({51}), IsEmpty());
  EXPECT_THAT(match({7, 7, 9}), ElementsAre(Pair(0, 1)));
  EXPECT_THAT(match({50, 50}), ElementsAre(Pair(0, 1)));
}

// OD-87: pairs are one to one.
TEST(MatchForTriangulation, AFeatureIsUsedOnce) {
  const TwoViews views({feature_at(400, 200, 9), feature_at(402, 200, 8)},
                       {feature_at(320, 200, 8), feature_at(330, 200, 30)});
  EXPECT_THAT(views.match(), ElementsAre(Pair(0, 0), Pair(1, 1)));
}

TEST(MatchForTriangulation, OnlyFeaturesWithoutPoints) {
  const std::vector<FeatureSpec> features{feature_at(400, 200, 0), feature_at(400, 300, 90)};
  for (const int side : {0, 1}) {
    TwoViews views(features, features);
    EXPECT_THAT(views.match(), ElementsAre(Pair(0, 0), Pair(1, 1)));
    const MapPointId point = views.map.add_point({0, 0, 5}, views.ids[side], 0);
    views.map.add_observation(point, views.ids[side], 0);
    EXPECT_THAT(views.match(), ElementsAre(Pair(1, 1)));
  }
}

TEST(MatchForTriangulation, OnlyUnderTheSameNode) {
  TwoViews views({}, {});
  auto a = make_synthetic_frame(1, {feature_at(400, 200, 0)});
  auto b = make_synthetic_frame(2, {feature_at(320, 200, 0)});
  put_under_nodes(*a, [](std::size_t) { return 4U; });
  put_under_nodes(*b, [](std::size_t) { return 5U; });
  const KeyFrameId id_a = views.map.add_keyframe(a, Pose());
  const KeyFrameId id_b = views.map.add_keyframe(b, at(1));
  EXPECT_THAT(match_for_triangulation(views.map, id_a, id_b), IsEmpty());
}

// OD-90: the epipole excludes nothing where the other camera lies behind.
TEST(MatchForTriangulation, NothingNearTheEpipoleOfSingleCameras) {
  // The second camera stands 1 m behind the first: the epipole is the image centre.
  const auto match = [](float u, float depth_a, float depth_b, double z) {
    return TwoViews({feature_at(328, 240, 0, 0, depth_a)}, {feature_at(u, 240, 0, 0, depth_b)},
                    at(0, 0, z))
        .match()
        .size();
  };
  EXPECT_EQ(match(329.9F, -1, -1, -1), 0U);  // within 10 pixels
  EXPECT_EQ(match(330.1F, -1, -1, -1), 1U);
  EXPECT_EQ(match(326, 5, -1, -1), 1U);  // depth of either side is enough
  EXPECT_EQ(match(326, -1, 5, -1), 1U);
  EXPECT_EQ(match(326, -1, -1, 1), 1U);  // the first camera is behind the second: no epipole
}

TEST(MatchForTriangulation, CamerasAtOnePlaceHaveNoEpipolarLines) {
  EXPECT_THAT(TwoViews({feature_at(400, 200, 0)}, {feature_at(400, 200, 0)}, Pose()).match(),
              IsEmpty());
}

TEST(MatchForTriangulation, RandomPerfectPairs) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    Scene scene(800, seed);
    std::mt19937_64 random(seed);
    ProjectionOptions options;
    options.with_depth = seed % 2 == 0;
    const Pose T_aw = small_motion(random, 0.05, 0.2), T_bw = small_motion(random, 0.05, 1.0);
    const KeyFrameId a = scene.add_keyframe(T_aw, options);
    const KeyFrameId b = scene.add_keyframe(T_bw, options);
    Eigen::Matrix3d K;
    K << 400, 0, 320, 0, 400, 240, 0, 0, 1;
    const Eigen::Matrix3d F = fundamental_matrix(T_aw, T_bw, K, K);
    const Pairs pairs = match_for_triangulation(scene.map, a, b);
    EXPECT_GT(pairs.size(), 200U);
    std::set<std::uint32_t> used;
    std::uint32_t previous = 0;
    for (const auto& [i, j] : pairs) {
      const Keypoint& x1 = scene.projected[0].frame->keypoints[i];
      const Keypoint& x2 = scene.projected[1].frame->keypoints[j];
      const Eigen::Vector3d line = F.transpose() * Eigen::Vector3d(x1.x, x1.y, 1);
      const double offset = line.dot(Eigen::Vector3d(x2.x, x2.y, 1)) / line.head<2>().norm();
      EXPECT_LT(offset * offset, 3.84);
      EXPECT_TRUE(used.insert(j).second);
      EXPECT_TRUE(used.size() == 1 || previous < i);
      EXPECT_EQ(scene.projected[0].points[i], scene.projected[1].points[j]);
      previous = i;
    }
  }
}

TEST(MatchForTriangulation, DeadKeyFramesAndMissingWords) {
  TwoViews views({feature_at(400, 200, 0)}, {feature_at(320, 200, 0)});
  EXPECT_THAT(match_for_triangulation(views.map, views.ids[0], KeyFrameId(9)), IsEmpty());
  const KeyFrameId wordless = views.map.add_keyframe(make_raster_frame(5, 3), at(2));
  EXPECT_THROW(match_for_triangulation(views.map, views.ids[0], wordless), StateError);
}

// ---- new points ------------------------------------------------------------------------------

constexpr std::size_t kShared = 60;  // points of the cloud that make keyframes neighbours

// Keyframes at the given x positions that share the first points of the cloud.
std::vector<KeyFrameId> add_row(Scene& scene, const std::vector<double>& xs, bool with_depth) {
  ProjectionOptions options;
  options.with_depth = with_depth;
  std::vector<KeyFrameId> ids;
  for (const double x : xs) {
    ids.push_back(scene.add_keyframe(at(x), options,
                                     with_depth ? synthetic_camera() : synthetic_camera(0, 0)));
    scene.observe(ids.back(), 0, kShared);
  }
  return ids;
}

// Every point that a keyframe observes lies where the cloud has it.
void expect_true_positions(const Scene& scene, KeyFrameId id) {
  const auto& seen = scene.projected[static_cast<std::size_t>(id.value)].points;
  const KeyFrame& keyframe = *scene.map.find(id);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const MapPoint* point = scene.map.find(keyframe.map_points[i]);
    if (!point) continue;
    EXPECT_LT((point->position - scene.cloud.positions[seen[i]]).norm(), 5e-3);
  }
}

TEST(CreateNewPoints, PerfectPairsGiveTruePoints) {
  for (const bool with_depth : {true, false}) {
    Scene scene(500, 4);
    const auto ids = add_row(scene, {0, 0.5}, with_depth);
    const std::size_t before = scene.map.n_points();
    NewPointOptions options;
    options.monocular = !with_depth;
    const auto created = create_new_points(scene.map, ids[1], options, nullptr);
    EXPECT_GT(created.size(), 150U);
    EXPECT_EQ(scene.map.n_points(), before + created.size());
    EXPECT_TRUE(std::is_sorted(created.begin(), created.end()));
    for (const MapPointId id : created) {
      const MapPoint& point = *scene.map.find(id);
      EXPECT_EQ(point.observation_count, with_depth ? 4 : 2);
      EXPECT_EQ(point.reference_keyframe, ids[1]);
      EXPECT_EQ(point.first_keyframe, ids[1]);
      EXPECT_GT(point.max_distance, 0);
      EXPECT_GT(point.mean_direction.norm(), 0.9);
    }
    expect_true_positions(scene, ids[0]);
    expect_true_positions(scene, ids[1]);
    scene.expect_consistent();
  }
}

// OD-87: every observation is there in the slot, too.
TEST(CreateNewPoints, EveryFeatureGetsAtMostOnePoint) {
  Scene scene(500, 8);
  const auto ids = add_row(scene, {0, 0.3, 0.6, 0.9}, true);
  const auto created = create_new_points(scene.map, ids[3], {}, nullptr);
  EXPECT_GT(created.size(), 150U);
  std::set<MapPointId> seen;
  for (const MapPointId id : scene.map.find(ids[3])->map_points) {
    EXPECT_TRUE(!id.valid() || seen.insert(id).second);
  }
  scene.expect_consistent();
  EXPECT_THAT(create_new_points(scene.map, ids[3], {}, nullptr), IsEmpty());
}

TEST(CreateNewPoints, StopsAfterTheFirstNeighbourWhenAsked) {
  // The neighbours see different parts of the cloud.
  const auto create = [](const std::atomic<bool>* flag) {
    Scene scene(800, 2);
    const auto ids = add_row(scene, {-0.8, 0.8, 0}, true);
    auto created = create_new_points(scene.map, ids[2], {}, flag);
    scene.expect_consistent();
    return created.size();
  };
  const std::atomic<bool> stop{true}, go_on{false};
  const std::size_t all = create(nullptr);
  EXPECT_EQ(create(&go_on), all);
  EXPECT_LT(create(&stop), all);
  EXPECT_GT(create(&stop), 0U);
}

TEST(CreateNewPoints, NeighboursCloserThanTheBaselineAreSkipped) {
  for (const double x : {0.099, 0.101}) {
    Scene scene(300, 3);
    const auto ids = add_row(scene, {0, x}, true);
    EXPECT_EQ(create_new_points(scene.map, ids[1], {}, nullptr).empty(), x < 0.1);
    scene.expect_consistent();
  }
}

TEST(CreateNewPoints, ASingleCamerasBaselineIsComparedWithTheDepth) {
  // All points 2 m away: 1 % is 2 cm, but 4.1 cm are needed for a parallax of 1.15 degrees; so
  // that the rule itself decides, most points are near and those that the median sees are far.
  const auto create = [](double far) {
    Scene scene(400, 3);
    for (std::size_t i = 0; i < scene.cloud.positions.size(); ++i) {
      scene.cloud.positions[i] *= (i < kShared ? far : 1.0) / scene.cloud.positions[i].z();
    }
    const auto ids = add_row(scene, {0, 0.1}, false);
    NewPointOptions options;
    options.monocular = true;
    const auto created = create_new_points(scene.map, ids[1], options, nullptr);
    scene.expect_consistent();
    return created.size();
  };
  EXPECT_GT(create(9.9), 50U);
  EXPECT_EQ(create(10.1), 0U);
}

TEST(CreateNewPoints, UsesNoMoreNeighboursThanAskedFor) {
  Scene scene(300, 3);
  const auto ids = add_row(scene, {0, 0.5}, true);
  NewPointOptions options;
  options.n_neighbours = 0;
  EXPECT_THAT(create_new_points(scene.map, ids[1], options, nullptr), IsEmpty());
}

TEST(CreateNewPoints, DeadKeyFrame) {
  Map map;
  EXPECT_THAT(create_new_points(map, KeyFrameId(3), {}, nullptr), IsEmpty());
}

TEST(CreateNewPoints, SameMapForTheSameInput) {
  const auto run = [] {
    Scene scene(500, 12);
    const auto ids = add_row(scene, {0, 0.3, 0.6}, true);
    create_new_points(scene.map, ids[2], {}, nullptr);
    std::vector<std::pair<std::int64_t, Eigen::Vector3d>> points;
    scene.map.for_each_point(
        [&](const MapPoint& p) { points.emplace_back(p.id.value, p.position); });
    return points;
  };
  EXPECT_EQ(run(), run());
}

}  // namespace
}  // namespace orbslam
