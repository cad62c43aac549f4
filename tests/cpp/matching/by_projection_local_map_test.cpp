// SPDX-License-Identifier: BSD-3-Clause
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/errors.hpp"
#include "matching/by_projection.hpp"
#include "matching/scenes.hpp"
#include "support/npy.hpp"

namespace orbslam {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using namespace testing;

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

FrustumView view_of(const MapPoint& seen) {
  TrackedFrame frame(make_synthetic_frame(0, {}));
  frame.T_cw = Pose();
  PointBatch batch;
  batch.push_back(seen);
  return project_into(frame, batch).at(0);
}

TEST(ProjectInto, TellsWhereAndHowAPointIsSeen) {
  MapPoint seen = point(0, {1, 0.5, 4}, Descriptor());
  seen.max_distance = 10;
  const FrustumView view = view_of(seen);
  ASSERT_TRUE(view.visible);
  EXPECT_FLOAT_EQ(view.u, 420);
  EXPECT_FLOAT_EQ(view.v, 290);
  EXPECT_FLOAT_EQ(view.right_u, 410);
  EXPECT_NEAR(view.view_cosine, 1, 1e-6);
  EXPECT_EQ(view.level, synthetic_scales()->predict_level(10, seen.position.norm()));
}

TEST(ProjectInto, DistanceLimits) {
  EXPECT_TRUE(view_of(point_ahead(4.01, 5, 100)).visible);  // 0.8 * 5 = 4
  EXPECT_FALSE(view_of(point_ahead(3.99, 5, 100)).visible);
  EXPECT_TRUE(view_of(point_ahead(5.99, 1, 5)).visible);  // 1.2 * 5 = 6
  EXPECT_FALSE(view_of(point_ahead(6.01, 1, 5)).visible);
}

TEST(ProjectInto, ViewingAngleLimitIsSixtyDegrees) {
  for (const double degrees : {0.0, 59.9, 60.1, 120.0, 180.0}) {
    MapPoint seen = point_ahead(5, 1, 100);
    const double angle = degrees * M_PI / 180;
    seen.mean_direction = {std::sin(angle), 0, std::cos(angle)};
    EXPECT_EQ(view_of(seen).visible, degrees < 60) << degrees;
  }
}

TEST(ProjectInto, BordersBelongToTheImage) {
  const auto at = [](double u) { return point(0, {(u - 320) / 80, 0, 5}, Descriptor()); };
  EXPECT_TRUE(view_of(at(0)).visible);
  EXPECT_TRUE(view_of(at(640)).visible);
  EXPECT_FALSE(view_of(at(-0.01)).visible);
  EXPECT_FALSE(view_of(at(640.01)).visible);
}

// OD-36: a depth of 0 or NaN fails.
TEST(ProjectInto, NothingBehindOrNowhere) {
  for (const Eigen::Vector3d& bad :
       {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0, 0, -5), Eigen::Vector3d(0, 0, kUnknown),
        Eigen::Vector3d(kUnknown, 0, 5), Eigen::Vector3d(0, 0, HUGE_VAL)}) {
    EXPECT_FALSE(view_of(point(0, bad, Descriptor())).visible) << bad.transpose();
  }
  MapPoint directionless = point_ahead(5, 1, 100);
  directionless.mean_direction = {kUnknown, 0, 0};
  EXPECT_FALSE(view_of(directionless).visible);
}

TEST(ProjectInto, NeedsAPose) {
  const TrackedFrame frame(make_synthetic_frame(0, {}));
  EXPECT_THROW(project_into(frame, PointBatch()), StateError);
}

// Points straight ahead at 5 m whose predicted level is 3 (max_distance = 5 * scale(3)), and a
// frame with the given features.
struct LocalScene {
  explicit LocalScene(const std::vector<FeatureSpec>& features)
      : frame(make_synthetic_frame(0, features)) {
    frame.T_cw = Pose();
  }
  LocalScene& add(std::int64_t id, int bits) {
    MapPoint ahead = point_ahead(5, 0.1, 5 * 1.7);
    ahead.id = MapPointId(id);
    ahead.descriptor = thermometer_descriptor(bits);
    points.push_back(ahead);
    return *this;
  }
  int match(float factor = 1) {
    result = match_local_map(frame, points, exclude, factor);
    return result.n_matches;
  }

  TrackedFrame frame;
  PointBatch points;
  std::vector<MapPointId> exclude;
  LocalMapMatches result;
};

TEST(MatchLocalMap, PredictedLevelAndTheFinerOne) {
  for (int level = 0; level < 8; ++level) {
    LocalScene scene({feature(level)});
    EXPECT_EQ(scene.add(0, 0).match(), level == 2 || level == 3 ? 1 : 0) << level;
  }
}

TEST(MatchLocalMap, RatioCountsOnTheSameLevelOnly) {
  const auto match = [](int best, std::int32_t best_level, int second, std::int32_t second_level) {
    LocalScene scene({feature(best_level, best), feature(second_level, second)});
    return scene.add(0, 0).match();
  };
  EXPECT_EQ(match(80, 3, 100, 3), 1);  // exactly 0.8 is good enough
  EXPECT_EQ(match(81, 3, 100, 3), 0);
  EXPECT_EQ(match(4, 3, 5, 3), 1);
  EXPECT_EQ(match(5, 3, 6, 3), 0);
  EXPECT_EQ(match(81, 3, 100, 2), 1);
  EXPECT_EQ(match(100, 3, 200, 3), 1);
  EXPECT_EQ(match(101, 3, 200, 3), 0);  // the descriptor limit
}

TEST(MatchLocalMap, RadiusDependsOnTheViewAndTheFactor) {
  const float scale = synthetic_scales()->scale(3);
  const auto match = [&](float offset, double cosine, float factor) {
    LocalScene scene({feature(3, 0, 320 + offset * scale)});
    MapPoint ahead = point_ahead(5, 0.1, 5 * 1.7);
    ahead.mean_direction *= cosine;
    scene.points.push_back(ahead);
    return scene.match(factor);
  };
  EXPECT_EQ(match(2.49F, 1, 1), 1);
  EXPECT_EQ(match(2.51F, 1, 1), 0);
  EXPECT_EQ(match(2.51F, 0.99, 1), 1);
  EXPECT_EQ(match(3.99F, 0.99, 1), 1);
  EXPECT_EQ(match(4.01F, 0.99, 1), 0);
  EXPECT_EQ(match(7.49F, 1, 3), 1);
  EXPECT_EQ(match(7.51F, 1, 3), 0);
}

TEST(MatchLocalMap, RightColumnMustAgree) {
  EXPECT_EQ(LocalScene({feature(3, 0, 320, 5)}).add(0, 0).match(), 1);
  EXPECT_EQ(LocalScene({feature(3, 0, 320, 3)}).add(0, 0).match(), 0);  // 5.3 px off
}

TEST(MatchLocalMap, EarlierPointsHavePriority) {
  LocalScene scene({feature(3)});
  EXPECT_EQ(scene.add(5, 30).add(6, 0).match(), 1);
  EXPECT_THAT(scene.frame.map_points, ElementsAre(MapPointId(5)));
  EXPECT_THAT(scene.result.visible, ElementsAre(MapPointId(5), MapPointId(6)));
}

TEST(MatchLocalMap, KnownAndExcludedPointsAreNotLookedAt) {
  LocalScene scene({feature(3), feature(3, 10, 100)});
  scene.frame.associate(1, MapPointId(4), {0, 0, 5});
  scene.exclude = {MapPointId(2), MapPointId(3)};
  EXPECT_EQ(scene.add(2, 0).add(3, 0).add(4, 0).match(), 0);
  EXPECT_THAT(scene.result.visible, IsEmpty());
  EXPECT_EQ(scene.add(5, 0).match(), 1);
  EXPECT_THAT(scene.result.visible, ElementsAre(MapPointId(5)));
}

TEST(MatchLocalMap, OnlyTemporaryPointsGiveWay) {
  LocalScene mapped({feature(3)});
  mapped.frame.associate(0, MapPointId(9), {0, 0, 5});
  EXPECT_EQ(mapped.add(1, 0).match(), 0);
  LocalScene temporary({feature(3)});
  temporary.frame.associate(0, kFirstTemporaryPoint, {0, 0, 5});
  EXPECT_EQ(temporary.add(1, 0).match(), 1);
  EXPECT_EQ(temporary.frame.map_points[0], MapPointId(1));
}

// Order of the area query: columns, then rows of the grid's 10 x 10 pixel cells, then index.
std::array<std::size_t, 3> query_order(const Keypoint& keypoint, std::size_t index) {
  const auto cell = [](float x, std::size_t n) {
    return std::min(static_cast<std::size_t>(std::round(x * 0.1F)), n - 1);
  };
  return {cell(keypoint.x, 64), cell(keypoint.y, 48), index};
}

// The same rules without grid, table of known points or early exits.
int brute_force(TrackedFrame& frame, const PointBatch& points, float factor) {
  const Frame& image = *frame.frame;
  const auto views = project_into(frame, points);
  int n = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!views[i].visible) continue;
    const float r =
        viewing_radius(views[i].view_cosine) * factor * image.scales->scale(views[i].level);
    std::vector<std::pair<int, std::array<std::size_t, 3>>> ranked;
    for (std::size_t k = 0; k < image.size(); ++k) {
      const Keypoint& keypoint = image.keypoints[k];
      if (frame.map_points[k].valid()) continue;
      if (keypoint.x > 640 || keypoint.y > 480) continue;  // noise: in no cell of the grid
      if (keypoint.level < views[i].level - 1 || keypoint.level > views[i].level) continue;
      if (!(std::abs(keypoint.x - views[i].u) < r && std::abs(keypoint.y - views[i].v) < r)) {
        continue;
      }
      if (image.has_depth(k) && std::abs(views[i].right_u - image.right_u[k]) > r) continue;
      ranked.emplace_back(hamming_distance(points.descriptors[i], image.descriptors[k]),
                          query_order(keypoint, k));
    }
    std::sort(ranked.begin(), ranked.end());
    if (ranked.empty() || ranked[0].first > 100) continue;
    if (ranked.size() > 1 &&
        image.keypoints[ranked[0].second[2]].level == image.keypoints[ranked[1].second[2]].level &&
        5 * ranked[0].first > 4 * ranked[1].first) {
      continue;
    }
    frame.associate(ranked[0].second[2], points.ids[i], points.positions[i]);
    ++n;
  }
  return n;
}

TEST(MatchLocalMap, EqualsBruteForceOnRandomScenes) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    std::mt19937_64 random(seed);
    PointCloud cloud = make_point_cloud(1500, 4, 3, 12, seed);
    // Few different descriptors, so that many candidates are close to each other.
    for (auto& descriptor : cloud.descriptors) {
      descriptor =
          flip_bits(thermometer_descriptor(80 * static_cast<int>(random() % 3)), 25, random);
    }
    ProjectionOptions options;
    options.pixel_noise = 2;
    options.flipped_bits = 10;
    options.level = 2;
    const ProjectedFrame image = project_cloud(0, cloud, Pose(), options);
    PointBatch points = batch_of(cloud);
    for (std::size_t i = 0; i < points.size(); ++i) {
      points.max_distances[i] = cloud.positions[i].norm() * uniform(random, 1.0, 2.0);
    }
    TrackedFrame ours(image.frame), expected(image.frame);
    ours.T_cw = expected.T_cw = small_motion(random, 0.002, 0.01);
    const auto result = match_local_map(ours, points, {}, 3);
    EXPECT_EQ(result.n_matches, brute_force(expected, points, 3));
    EXPECT_GT(result.n_matches, 100);
    EXPECT_EQ(ours.map_points, expected.map_points);
  }
}

TEST(MatchLocalMap, NeedsAPose) {
  LocalScene scene({feature(3)});
  scene.frame.T_cw.reset();
  EXPECT_THROW(scene.match(), StateError);
}

TEST(MatchingGolden, HammingDistance) {
  const std::string folder = test_data("golden/misc/");
  const auto a = read_npy<std::uint8_t>(folder + "descA.npy");
  const auto b = read_npy<std::uint8_t>(folder + "descB.npy");
  const auto expected = read_npy<int>(folder + "out_hamming.npy");
  for (std::size_t i = 0; i < expected.rows(); ++i) {
    Descriptor first, second;
    std::memcpy(first.words.data(), a.values.data() + 32 * i, 32);
    std::memcpy(second.words.data(), b.values.data() + 32 * i, 32);
    EXPECT_EQ(hamming_distance(first, second), expected.at(i));
    int bits = 0;
    for (std::size_t k = 0; k < 32; ++k) {
      for (int x = a.at(i, k) ^ b.at(i, k); x; x &= x - 1) ++bits;
    }
    EXPECT_EQ(bits, expected.at(i));
  }
}

TEST(MatchingGolden, ViewingRadius) {
  const auto cosines = read_npy<float>(test_data("golden/misc/viewcos.npy"));
  const auto expected = read_npy<float>(test_data("golden/misc/out_radius.npy"));
  for (std::size_t i = 0; i < expected.rows(); ++i) {
    EXPECT_EQ(viewing_radius(cosines.at(i)), expected.at(i)) << cosines.at(i);
  }
}

// The original computes in float32, so that ratios within 1e-6 of a level boundary may fall on
// either side; everything else must be identical.
TEST(MatchingGolden, PredictedLevel) {
  const std::string folder = test_data("golden/misc/");
  const auto max_distance = read_npy<float>(folder + "ps_maxdist.npy");
  const auto distance = read_npy<float>(folder + "ps_dist.npy");
  const auto expected = read_npy<int>(folder + "out_scale.npy");
  int different = 0;
  for (std::size_t i = 0; i < expected.rows(); ++i) {
    const int level = synthetic_scales()->predict_level(max_distance.at(i), distance.at(i));
    if (level == expected.at(i)) continue;
    ++different;
    const double exact = std::log(static_cast<double>(max_distance.at(i)) / distance.at(i)) /
                         std::log(static_cast<double>(synthetic_scales()->factor()));
    EXPECT_LT(std::abs(exact - std::round(exact)), 1e-5) << i;
    EXPECT_EQ(std::abs(level - expected.at(i)), 1) << i;
  }
  EXPECT_LE(different, 36);
}

}  // namespace
}  // namespace orbslam
