// SPDX-License-Identifier: BSD-3-Clause
#include "matching/by_projection.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/errors.hpp"
#include "matching/scenes.hpp"

namespace orbslam {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using namespace testing;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// One point straight ahead, 5 m away, seen by the last frame at (320, 240) on level 3, and a
// current frame with the given features.
struct OnePoint {
  explicit OnePoint(const std::vector<FeatureSpec>& features, const FeatureSpec& seen = feature(3))
      : last(make_synthetic_frame(0, {seen})), current(make_synthetic_frame(1, features)) {
    last.T_cw = Pose();
    current.T_cw = Pose();
    last.associate(0, MapPointId(7), {0, 0, 5});
    batch.push_back(point(7, {0, 0, 5}, seen.descriptor));
  }

  int match(float radius = 7, bool use_depth = true) {
    return match_last_frame(current, last, batch, radius, use_depth);
  }

  TrackedFrame last, current;
  PointBatch batch;
};

// Levels on which a feature is found after the camera moved by `z` along its axis.
std::vector<int> levels_found(double z, bool use_depth) {
  std::vector<int> found;
  for (int level = 0; level < 8; ++level) {
    OnePoint scene({feature(level)});
    scene.current.T_cw = Pose(Eigen::Quaterniond::Identity(), {0, 0, -z});
    if (scene.match(7, use_depth) == 1) found.push_back(level);
  }
  return found;
}

TEST(MatchLastFrame, MovingForwardsAllowsCoarserLevels) {
  EXPECT_THAT(levels_found(0.11, true), ElementsAre(3, 4, 5, 6, 7));
}
TEST(MatchLastFrame, MovingBackwardsAllowsFinerLevels) {
  EXPECT_THAT(levels_found(-0.11, true), ElementsAre(0, 1, 2, 3));
}
TEST(MatchLastFrame, StandingAllowsNeighbouringLevels) {
  EXPECT_THAT(levels_found(0, true), ElementsAre(2, 3, 4));
  EXPECT_THAT(levels_found(0.1, true), ElementsAre(2, 3, 4));  // one baseline is not more than it
  EXPECT_THAT(levels_found(-0.1, true), ElementsAre(2, 3, 4));
}
TEST(MatchLastFrame, ASingleCameraDoesNotKnowItsMotionInMetres) {
  EXPECT_THAT(levels_found(0.5, false), ElementsAre(2, 3, 4));
}

TEST(MatchLastFrame, WindowGrowsWithTheKeypointsScale) {
  const float window = 7 * synthetic_scales()->scale(3);
  EXPECT_EQ(OnePoint({feature(3, 0, 320 + window - 0.01F)}).match(), 1);
  EXPECT_EQ(OnePoint({feature(3, 0, 320 + window + 0.01F)}).match(), 0);
}

TEST(MatchLastFrame, RightColumnMustAgree) {
  // bf = 40: at 5 m the right column is 8 px to the left, at 2 m 20 px, at 4 m 10 px.
  const FeatureSpec level_0 = feature(0);
  EXPECT_EQ(OnePoint({feature(0, 0, 320, 5)}, level_0).match(), 1);
  EXPECT_EQ(OnePoint({feature(0, 0, 320, 4)}, level_0).match(), 1);
  EXPECT_EQ(OnePoint({feature(0, 0, 320, 2)}, level_0).match(), 0);
  EXPECT_EQ(OnePoint({feature(0, 0, 320, 2)}, level_0).match(12.01F), 1);
}

// OD-35: the right column of a near point may be negative.
TEST(MatchLastFrame, NegativeVirtualColumnsCountAsDepth) {
  const Eigen::Vector3d near(-0.75, 0, 1);  // u = 20, right column -20
  for (const float measured : {1.0F, 2.0F}) {
    OnePoint scene({feature(0, 0, 20, measured)}, feature(0));
    scene.last.positions[0] = near;
    // Measured at 2 m the feature's column is 0: 20 px off.
    EXPECT_EQ(scene.match(), measured == 1.0F ? 1 : 0);
  }
}

TEST(MatchLastFrame, DescriptorLimitIsAHundredInclusive) {
  EXPECT_EQ(OnePoint({feature(3, 100)}).match(), 1);
  EXPECT_EQ(OnePoint({feature(3, 101)}).match(), 0);
}

TEST(MatchLastFrame, BestDescriptorWinsAndTheFirstOfEquals) {
  OnePoint better({feature(3, 20), feature(3, 10)});
  EXPECT_EQ(better.match(), 1);
  EXPECT_THAT(better.current.map_points, ElementsAre(MapPointId(), MapPointId(7)));
  OnePoint equal({feature(3, 10), feature(3, 10)});
  EXPECT_EQ(equal.match(), 1);
  EXPECT_THAT(equal.current.map_points, ElementsAre(MapPointId(7), MapPointId()));
  EXPECT_EQ(equal.current.positions[0], Eigen::Vector3d(0, 0, 5));
}

// OD-36: a depth of 0 or NaN fails.
TEST(MatchLastFrame, PointsBehindTheCameraOrNowhereAreSkipped) {
  for (const Eigen::Vector3d& bad :
       {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0, 0, -5), Eigen::Vector3d(0, 0, kNan),
        Eigen::Vector3d(kNan, 0, 5), Eigen::Vector3d(0, HUGE_VAL, 5), Eigen::Vector3d(9, 0, 5)}) {
    OnePoint scene({feature(3)});
    scene.last.positions[0] = bad;
    EXPECT_EQ(scene.match(), 0) << bad.transpose();
  }
}

TEST(MatchLastFrame, FramesIncludeTheirUpperBounds) {
  for (const double u : {0.0, 640.0, -0.01, 640.01}) {
    const double clamped = std::min(std::max(u, 0.0), 640.0);
    OnePoint scene({feature(3, 0, static_cast<float>(clamped))});
    scene.last.positions[0] = {(u - 320) * 5 / 400, 0, 5};
    EXPECT_EQ(scene.match(), u == clamped ? 1 : 0) << u;
  }
}

// OD-77: dead points of the last frame are not matched.
TEST(MatchLastFrame, OutliersAndDeadPointsAreSkipped) {
  OnePoint outlier({feature(3)});
  outlier.last.outlier[0] = 1;
  EXPECT_EQ(outlier.match(), 0);
  OnePoint dead({feature(3)});
  dead.batch.clear();
  EXPECT_EQ(dead.match(), 0);
}

TEST(MatchLastFrame, AMappedPointKeepsItsKeypointATemporaryOneDoesNot) {
  OnePoint mapped({feature(3)});
  mapped.current.associate(0, MapPointId(99), {1, 1, 1});
  EXPECT_EQ(mapped.match(), 0);
  EXPECT_EQ(mapped.current.map_points[0], MapPointId(99));
  OnePoint temporary({feature(3)});
  temporary.current.associate(0, kFirstTemporaryPoint, {1, 1, 1});
  EXPECT_EQ(temporary.match(), 1);
  EXPECT_EQ(temporary.current.map_points[0], MapPointId(7));
}

// OD-78: it neither counts twice nor is judged by the match that was overwritten.
TEST(MatchLastFrame, AKeypointTakenTwiceCountsOnceWithItsLastRotation) {
  // 30 points turned by 0 degrees; keypoint 0 is first taken by a temporary point that is turned
  // by 90 degrees, then by a point that is not turned.
  std::vector<FeatureSpec> seen, now;
  std::mt19937_64 random(1);
  for (int i = 0; i < 30; ++i) {
    FeatureSpec spec = feature(0, 0, 20.0F + 20.0F * static_cast<float>(i));
    spec.descriptor = random_descriptor(random);
    now.push_back(spec);
    seen.push_back(spec);
  }
  FeatureSpec turned = seen[0];
  turned.angle = 90;
  seen.insert(seen.begin(), turned);
  TrackedFrame last(make_synthetic_frame(0, seen)), current(make_synthetic_frame(1, now));
  last.T_cw = current.T_cw = Pose();
  PointBatch batch;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const MapPointId id = i == 0 ? kFirstTemporaryPoint : MapPointId(static_cast<std::int64_t>(i));
    const Eigen::Vector3d position((seen[i].u - 320.0) / 80.0, 0, 5);
    last.associate(i, id, position);
    batch.push_back(point(id.value, position, seen[i].descriptor));
  }
  EXPECT_EQ(match_last_frame(current, last, batch, 7, true), 30);
  EXPECT_EQ(current.map_points[0], MapPointId(1));
}

TEST(MatchLastFrame, RotationMustAgreeWithTheMajority) {
  const PointCloud cloud = make_point_cloud(100, 2, 4, 8, 3);
  ProjectedFrame seen = project_cloud(0, cloud, Pose()), now = project_cloud(1, cloud, Pose());
  seen.frame->keypoints[5].angle = 180;
  TrackedFrame last = associate_all(seen, cloud, Pose()), current(now.frame);
  current.T_cw = Pose();
  const int n = static_cast<int>(seen.points.size());
  EXPECT_EQ(match_last_frame(current, last, batch_of(cloud), 15, true), n - 1);
  EXPECT_FALSE(current.map_points[5].valid());
}

TEST(MatchLastFrame, RandomScenesMatchOnlyTheRightPoints) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    std::mt19937_64 random(seed);
    const PointCloud cloud = make_point_cloud(600, 4, 3, 12, seed);
    const Pose T_cw = small_motion(random, 0.02, 0.05);
    ProjectionOptions options;
    options.pixel_noise = 1;
    options.flipped_bits = 20;
    options.seed = seed + 1;
    const ProjectedFrame seen = project_cloud(0, cloud, Pose());
    const ProjectedFrame now = project_cloud(1, cloud, T_cw, options);
    const TrackedFrame last = associate_all(seen, cloud, Pose());
    TrackedFrame current(now.frame);
    current.T_cw = T_cw;
    const int n = match_last_frame(current, last, batch_of(cloud), 15, false);
    int correct = 0;
    for (std::size_t i = 0; i < now.points.size(); ++i) {
      if (!current.map_points[i].valid()) continue;
      EXPECT_EQ(current.map_points[i].value, static_cast<std::int64_t>(now.points[i]));
      ++correct;
    }
    EXPECT_EQ(correct, n);
    EXPECT_GT(n, 0.9 * static_cast<double>(seen.points.size()));
  }
}

TEST(MatchLastFrame, NeedsBothPoses) {
  OnePoint scene({feature(3)});
  scene.last.T_cw.reset();
  EXPECT_THROW(scene.match(), StateError);
  OnePoint other({feature(3)});
  other.current.T_cw.reset();
  EXPECT_THROW(other.match(), StateError);
}

}  // namespace
}  // namespace orbslam
