// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/inertial_keyframes.hpp"

#include <gtest/gtest.h>

#include "map/culling.hpp"
#include "optimize/bundle_gather.hpp"
#include "support/analytic_motion.hpp"
#include "support/synthetic_frames.hpp"

namespace orbslam {
namespace {

using testing::AnalyticMotion;
using testing::kNoise;
using testing::kT_cb;

constexpr double kSample = 0.2;

KeyFrameId id(std::size_t k) { return KeyFrameId(static_cast<std::int64_t>(k)); }

/// Keyframes 0.2 s apart that all see the same points, on a known motion.
struct Chain {
  Map map;
  InertialKeyframes inertial{kT_cb, kNoise};

  explicit Chain(std::size_t n) {
    for (std::size_t k = 0; k < n; ++k) {
      const double t = kSample * static_cast<double>(k);
      auto frame = testing::make_raster_frame(static_cast<std::int64_t>(k), 60, -1, 0,
                                              testing::synthetic_camera(), 0);
      frame->timestamp = t;
      const Pose T_wb(AnalyticMotion::rotation(t), AnalyticMotion::position(t));
      const Pose T_cw = kT_cb * T_wb.inverse();
      map.publish(map.add_keyframe(frame, T_cw));
      inertial.set(id(k), T_cw.rotation() * AnalyticMotion::velocity(t), testing::kBias);
    }
    for (std::size_t slot = 0; slot < 60; ++slot) {
      const MapPointId point = map.add_point({0, 0, 5}, id(0), 0);
      for (std::size_t k = 0; k < n; ++k) map.add_observation(point, id(k), slot);
      map.update_point(point);
    }
    for (std::size_t k = 0; k < n; ++k) map.update_connections(id(k));
    const double end = kSample * static_cast<double>(n - 1);
    inertial.add_samples(AnalyticMotion::samples(0, end, static_cast<int>(100 * end)));
  }

  std::vector<KeyFrameId> cull(std::size_t current) {
    return cull_keyframes(map, id(current), false,
                          [&](KeyFrameId keyframe) { return inertial.is_needed(map, keyframe); });
  }
  double longest_gap() const {
    double last = 0, longest = 0;
    map.for_each_keyframe([&](const KeyFrame& keyframe) {
      longest = std::max(longest, keyframe.frame->timestamp - last);
      last = keyframe.frame->timestamp;
    });
    return longest;
  }
};

TEST(InertialCulling, LeavesNoGapOverHalfASecond) {
  Chain chain(12), without(12);
  const std::vector<KeyFrameId> dead = chain.cull(11);
  EXPECT_FALSE(dead.empty());
  EXPECT_NEAR(chain.longest_gap(), 2 * kSample, 1e-9);
  cull_keyframes(without.map, id(11), false);
  EXPECT_GT(without.longest_gap(), 0.5);
}

TEST(InertialCulling, MayLeaveThreeSecondsLongAgo) {
  // Neighbours of the newest one: all see the same.
  Chain chain(150);
  chain.cull(149);
  EXPECT_GT(chain.longest_gap(), 2.5);
  EXPECT_LE(chain.longest_gap(), 3 + 1e-9);
  double last = 0;
  chain.map.for_each_keyframe([&](const KeyFrame& keyframe) {
    const double t = keyframe.frame->timestamp;
    if (last > 149 * kSample - 15) {
      EXPECT_LE(t - last, 0.5);
    }
    last = t;
  });
}

TEST(InertialCulling, NeighboursInTimeAreJoined) {
  Chain chain(4);
  const auto links = [&] {
    GatheredBundle bundle(chain.map);
    chain.map.for_each_keyframe([&](const KeyFrame& k) { bundle.add_camera(k, false); });
    chain.inertial.add_to(bundle, chain.inertial.newest(chain.map, 0, 10), chain.map);
    return bundle.problem.inertial.links;
  };
  const auto before = links();
  ASSERT_EQ(before.size(), 3U);
  ASSERT_TRUE(chain.map.erase_keyframe(id(2)));
  const auto after = links();
  ASSERT_EQ(after.size(), 2U);
  const Preintegration expected = before[1].motion->joined(*before[2].motion);
  const Preintegration& joined = *after[1].motion;
  EXPECT_NEAR(joined.duration(), 2 * kSample, 1e-12);
  EXPECT_LT(joined.motion().dR.angularDistance(expected.motion().dR), 1e-9);
  EXPECT_LT((joined.motion().dv - expected.motion().dv).norm(), 1e-9);
  EXPECT_LT((joined.motion().dp - expected.motion().dp).norm(), 1e-9);
  EXPECT_LT((joined.covariance() - expected.covariance()).norm(),
            1e-6 * expected.covariance().norm());
}

TEST(InertialKeyframesVelocity, TurnsWithItsKeyframe) {
  Chain chain(3);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()));
  for (std::size_t k = 0; k < 3; ++k) {
    const Pose T_cw = chain.map.T_cw(id(k));
    chain.map.set_pose(id(k), T_cw * Pose(turn, Eigen::Vector3d(1, 2, 3)).inverse());
  }
  GatheredBundle bundle(chain.map);
  chain.map.for_each_keyframe([&](const KeyFrame& k) { bundle.add_camera(k, false); });
  chain.inertial.add_to(bundle, chain.inertial.newest(chain.map, 0, 10), chain.map);
  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Vector3d expected =
        turn * AnalyticMotion::velocity(kSample * static_cast<double>(k));
    EXPECT_LT((bundle.problem.inertial.motions[k].velocity - expected).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace orbslam
