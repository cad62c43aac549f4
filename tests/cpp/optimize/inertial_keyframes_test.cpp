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

/// Of all keyframes of the chain's map.
InertialRows take(const Chain& chain, const InertialKeyframes& from,
                  const std::vector<std::array<std::int64_t, 3>>& known = {}) {
  std::vector<KeyFrameId> ids;
  std::vector<double> times;
  chain.map.for_each_keyframe([&](const KeyFrame& keyframe) {
    ids.push_back(keyframe.id);
    times.push_back(keyframe.frame->timestamp);
  });
  return from.take(ids, times, known);
}

void expect_equal(const InertialRows& a, const InertialRows& b) {
  ASSERT_EQ(a.ids, b.ids);
  EXPECT_EQ(a.velocity, b.velocity);
  EXPECT_EQ(a.scale, b.scale);
  EXPECT_EQ(a.offsets, b.offsets);
  ASSERT_EQ(a.samples.size(), b.samples.size());
  for (std::size_t i = 0; i < a.samples.size(); ++i) {
    EXPECT_EQ(a.samples[i].t, b.samples[i].t);
    EXPECT_EQ(a.samples[i].gyro, b.samples[i].gyro);
    EXPECT_EQ(a.samples[i].accel, b.samples[i].accel);
  }
  for (std::size_t i = 0; i < a.ids.size(); ++i) {
    EXPECT_EQ(a.bias[i].gyro, b.bias[i].gyro);
    EXPECT_EQ(a.bias[i].accel, b.bias[i].accel);
  }
}

std::vector<BundleProblem::ImuLink> links_of(const Chain& chain,
                                             const InertialKeyframes& inertial) {
  std::vector<KeyFrameId> ids;
  GatheredBundle bundle(chain.map);
  chain.map.for_each_keyframe([&](const KeyFrame& k) {
    bundle.add_camera(k, false);
    ids.push_back(k.id);
  });
  inertial.add_to(bundle, ids, chain.map);
  return bundle.problem.inertial.links;
}

/// What a restored one has, with the samples as those of the present run, to be linked.
void resume(const InertialRows& rows, InertialKeyframes& restored) {
  for (std::size_t i = 0; i < rows.ids.size(); ++i) {
    restored.set(rows.ids[i], rows.velocity[i], rows.bias[i], rows.scale[i]);
  }
  restored.add_samples(rows.samples);
}

TEST(StoredStates, ComeBackAsTheyWere) {
  Chain chain(5);
  chain.inertial.set(id(2), {1, 2, 3}, {{0.1, 0.2, 0.3}, {0.4, 0.5, 0.6}}, 1.5);
  const InertialRows rows = take(chain, chain.inertial);
  ASSERT_EQ(rows.ids.size(), 5U);
  EXPECT_EQ(rows.offsets[0], rows.offsets[1]) << "nothing comes before the first";
  for (std::size_t i = 1; i < 5; ++i) {
    const double begin = rows.samples[rows.offsets[i]].t;
    const double end = rows.samples[rows.offsets[i + 1] - 1].t;
    EXPECT_NEAR(begin, kSample * static_cast<double>(i - 1), 1e-6);
    EXPECT_NEAR(end, kSample * static_cast<double>(i), 1e-6);
  }
  InertialKeyframes restored(kT_cb, kNoise);
  restored.put(rows);
  expect_equal(take(chain, restored), rows);
  ImuBias bias;
  ASSERT_TRUE(restored.newest_bias(bias));
  EXPECT_EQ(bias.gyro, testing::kBias.gyro);
}

TEST(StoredStates, GiveTheSamePreintegrationsAlsoWhereOneIsCulled) {
  for (const int rate : {100, 93}) {  // samples at the keyframes, and beside them
    Chain chain(6);
    chain.inertial.clear();
    for (std::size_t k = 0; k < 6; ++k) chain.inertial.set(id(k), {0, 0, 0}, testing::kBias);
    chain.inertial.add_samples(AnalyticMotion::samples(-0.1, 1.1, rate));
    InertialKeyframes restored(kT_cb, kNoise);
    resume(take(chain, chain.inertial), restored);
    for (const bool culled : {false, true}) {
      if (culled) {
        ASSERT_TRUE(chain.map.erase_keyframe(id(3)));
      }
      const auto before = links_of(chain, chain.inertial), after = links_of(chain, restored);
      ASSERT_EQ(after.size(), culled ? 4U : 5U);
      for (std::size_t i = 0; i < after.size(); ++i) {
        const Preintegration &one = *before[i].motion, &other = *after[i].motion;
        EXPECT_EQ(one.motion().dv, other.motion().dv);
        EXPECT_EQ(one.motion().dp, other.motion().dp);
        EXPECT_EQ(one.covariance(), other.covariance());
      }
      // What is stored without the culled one reaches over it.
      InertialKeyframes again(kT_cb, kNoise);
      again.put(take(chain, restored));
      expect_equal(take(chain, again), take(chain, chain.inertial));
    }
  }
}

TEST(StoredStates, HaveNoSamplesWhereNoneJoinThem) {
  Chain chain(4);
  chain.inertial.clear();
  for (std::size_t k = 0; k < 4; ++k) chain.inertial.set(id(k), {0, 0, 0}, {});
  chain.inertial.add_samples(AnalyticMotion::samples(kSample, 3 * kSample, 40));
  const InertialRows rows = take(chain, chain.inertial);
  EXPECT_EQ(rows.offsets[1], rows.offsets[2]);
  EXPECT_LT(rows.offsets[2], rows.offsets[3]);
  InertialKeyframes restored(kT_cb, kNoise);
  restored.put(rows);
  expect_equal(take(chain, restored), rows);
}

TEST(StoredStates, AreNotJoinedToThoseOfTheNextRun) {
  Chain chain(6);
  const InertialRows rows = take(chain, chain.inertial);
  InertialKeyframes restored(kT_cb, kNoise);
  InertialRows earlier = rows;
  earlier.ids.resize(3);
  restored.put(earlier);
  EXPECT_TRUE(restored.newest(chain.map, 0, 10).empty());
  EXPECT_TRUE(links_of(chain, restored).empty());
  // Times begin anew: these samples are not older ones that come late.
  restored.add_samples(AnalyticMotion::samples(0, 1, 100));
  for (std::size_t k = 3; k < 6; ++k) restored.set(id(k), {0, 0, 0}, {});
  EXPECT_EQ(restored.newest(chain.map, 0, 10).size(), 3U);
  EXPECT_FALSE(restored.is_needed(chain.map, id(1)));
  EXPECT_FALSE(restored.is_needed(chain.map, id(3)));
  EXPECT_TRUE(restored.is_needed(chain.map, id(5)));
  const InertialRows both = take(chain, restored);
  EXPECT_EQ(both.offsets[3], both.offsets[4]) << "nothing joins the runs";
  EXPECT_LT(both.offsets[4], both.offsets[5]);
}

TEST(StoredStates, ComeWithoutSamplesWhereTheyAreKnown) {
  Chain chain(5);
  const InertialRows rows = take(chain, chain.inertial);
  InertialRows again = take(chain, chain.inertial, rows.versions);
  EXPECT_EQ(again.versions, rows.versions);
  EXPECT_EQ(again.changed, std::vector<std::uint8_t>(5, 0));
  EXPECT_TRUE(again.samples.empty());
  chain.inertial.set(id(1), {1, 0, 0}, {});
  again = take(chain, chain.inertial, rows.versions);
  EXPECT_EQ(again.changed, (std::vector<std::uint8_t>{0, 1, 0, 0, 0}));
  ASSERT_TRUE(chain.map.erase_keyframe(id(1)));
  again = take(chain, chain.inertial, rows.versions);
  EXPECT_EQ(again.changed, (std::vector<std::uint8_t>{0, 1, 0, 0})) << "another one comes before";
  EXPECT_GT(again.samples.size(), 35U);
}

}  // namespace
}  // namespace orbslam
