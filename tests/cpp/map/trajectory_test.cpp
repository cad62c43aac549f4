// SPDX-License-Identifier: BSD-3-Clause
#include "map/trajectory.hpp"

#include <gtest/gtest.h>

#include "base/errors.hpp"
#include "map/anchor.hpp"
#include "map_builder.hpp"

namespace orbslam::testing {
namespace {

Pose random_pose(std::mt19937_64& random) {
  Vector6d xi;
  for (int i = 0; i < 6; ++i) xi[i] = uniform(random, -1, 1);
  return Pose::exp(xi);
}

Eigen::Matrix4d matrix(const Matrix4& values) {
  return Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values.data());
}

TrackedFrame tracked(const Map& map, FrameId id, const Pose& T_cw, KeyFrameId reference) {
  TrackedFrame frame(make_raster_frame(id, 1));
  frame.T_cw = T_cw;
  anchor_frame(map, frame, reference);
  return frame;
}

// OD-19: relative to keyframe 0, wherever it has moved to.
TEST(Trajectory, ReturnsWhatWasRecordedAnchoredAtKeyframeZero) {
  MapBuilder builder;
  builder.add_keyframes(3);
  std::mt19937_64 random(1);
  for (int k = 0; k < 3; ++k) builder.map.set_pose(kf(k), random_pose(random));
  TrajectoryRecorder recorder;
  std::vector<Pose> poses;
  for (int i = 0; i < 9; ++i) {
    poses.push_back(random_pose(random));
    recorder.record(builder.map, tracked(builder.map, i + 4, poses.back(), kf(i / 3)), i == 5);
  }
  const Trajectory trajectory = recorder.rebuild(builder.map);
  ASSERT_EQ(trajectory.T_wc.size(), 9U);
  const Pose T_0w = builder.map.T_cw(kf(0));
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_TRUE(matrix(trajectory.T_wc[i]).isApprox((T_0w * poses[i].inverse()).matrix(), 1e-12));
    EXPECT_EQ(trajectory.frames[i], static_cast<FrameId>(i) + 4);
    EXPECT_DOUBLE_EQ(trajectory.timestamps[i], static_cast<double>(i + 4) / 30);
    EXPECT_EQ(trajectory.lost[i], i == 5 ? 1 : 0);
  }
}

TEST(Trajectory, FramesMoveWithTheirKeyframesAlsoWhenThoseWereCulled) {
  MapBuilder builder;
  builder.add_keyframes(4);  // a chain 0 - 1 - 2 - 3
  TrajectoryRecorder recorder;
  const Pose T_c3 = Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.1, 0.2, 0.3));
  recorder.record(builder.map, tracked(builder.map, 0, T_c3 * builder.map.T_cw(kf(3)), kf(3)),
                  false);
  const Pose T_31 = builder.map.T_cw(kf(3)) * builder.map.T_cw(kf(1)).inverse();
  ASSERT_TRUE(builder.erase_keyframe(kf(3)));
  ASSERT_TRUE(builder.erase_keyframe(kf(2)));
  std::mt19937_64 random(2);
  const Pose T_0w = random_pose(random), T_1w = random_pose(random);
  builder.map.set_pose(kf(0), T_0w);
  builder.map.set_pose(kf(1), T_1w);
  const Pose expected = (T_c3 * T_31 * T_1w * T_0w.inverse()).inverse();
  EXPECT_TRUE(matrix(recorder.rebuild(builder.map).T_wc[0]).isApprox(expected.matrix(), 1e-12));
  // A frame recorded against a keyframe that is dead already.
  recorder.record(builder.map, tracked(builder.map, 1, T_c3 * builder.map.T_cw(kf(3)), kf(3)),
                  false);
  EXPECT_TRUE(matrix(recorder.rebuild(builder.map).T_wc[1]).isApprox(expected.matrix(), 1e-12));
}

TEST(Trajectory, LengthsFollowAChangeOfScaleThroughCulledKeyframesToo) {
  MapBuilder builder;
  builder.add_keyframes(4);
  TrajectoryRecorder recorder;
  const Pose T_c3 = Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.1, 0.2, 0.3));
  const Pose T_3w = builder.map.T_cw(kf(3));
  builder.map.rescale(kf(3), 0.5);  // an earlier loop
  recorder.record(builder.map, tracked(builder.map, 0, T_c3 * T_3w, kf(3)), false);
  ASSERT_TRUE(builder.erase_keyframe(kf(3)));
  // The whole map grows to twice its size.
  for (const KeyFrameId id : builder.map.keyframe_ids()) {
    const Pose T_cw = builder.map.T_cw(id);
    builder.map.set_pose(id, Pose(T_cw.rotation(), 2 * T_cw.translation()));
    builder.map.rescale(id, 2);
  }
  EXPECT_DOUBLE_EQ(builder.map.scaled_pose(kf(3)).scale, 1.0);
  const Pose T_cw = T_c3 * T_3w;
  const Pose expected = Pose(T_cw.rotation(), 2 * T_cw.translation()).inverse();
  const Pose T_0w = builder.map.T_cw(kf(0));
  EXPECT_TRUE(
      matrix(recorder.rebuild(builder.map).T_wc[0]).isApprox((T_0w * expected).matrix(), 1e-12));
}

// OD-13: not with the time of the frame before.
TEST(Trajectory, WithoutAPoseTheLastRelativeOneIsRepeatedWithItsOwnTime) {
  MapBuilder builder;
  builder.add_keyframes(2);
  TrajectoryRecorder recorder;
  TrackedFrame nothing(make_raster_frame(1, 1));
  recorder.record(builder.map, nothing, false);
  recorder.record(builder.map, tracked(builder.map, 2, builder.map.T_cw(kf(1)), kf(1)), false);
  TrackedFrame lost(make_raster_frame(3, 1));
  recorder.record(builder.map, lost, true);
  const Trajectory trajectory = recorder.rebuild(builder.map);
  EXPECT_EQ(trajectory.lost, (std::vector<std::uint8_t>{1, 0, 1}));
  EXPECT_EQ(matrix(trajectory.T_wc[0]), Eigen::Matrix4d::Identity());
  EXPECT_EQ(trajectory.T_wc[1], trajectory.T_wc[2]);
  EXPECT_DOUBLE_EQ(trajectory.timestamps[2], 3.0 / 30);
}

TEST(Trajectory, EndsWithItsMap) {
  MapBuilder builder;
  builder.add_keyframe();
  TrajectoryRecorder recorder;
  EXPECT_TRUE(recorder.rebuild(builder.map).T_wc.empty());
  recorder.record(builder.map, tracked(builder.map, 0, Pose(), kf(0)), false);
  EXPECT_THROW(tracked(builder.map, 0, Pose(), kf(9)), StateError);
  EXPECT_EQ(recorder.size(), 1U);
  const TrackedFrame late = tracked(builder.map, 0, Pose(), kf(0));
  builder.map.clear();
  EXPECT_THROW(recorder.rebuild(builder.map), StateError);
  EXPECT_THROW(recorder.record(builder.map, late, false), StateError);
  recorder.clear();
  EXPECT_TRUE(recorder.rebuild(builder.map).frames.empty());
}

TEST(Trajectory, TakesLessThan120BytesAFrame) {
  MapBuilder builder;
  builder.add_keyframe();
  TrajectoryRecorder recorder;
  const TrackedFrame frame = tracked(builder.map, 0, Pose(), kf(0));
  for (std::size_t n = 1; n <= 60000; ++n) {
    recorder.record(builder.map, frame, false);
    if (n < 5000) continue;
    ASSERT_LE(recorder.n_bytes(), 120 * n) << n;
  }
}

}  // namespace
}  // namespace orbslam::testing
