// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/keyframe_alignment.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "optimize/bundle_gather.hpp"
#include "optimize/frame_alignment.hpp"
#include "optimize/local_bundle_adjustment.hpp"
#include "optimize/pose_optimization.hpp"
#include "optimize/textured_wall.hpp"

namespace orbslam::testing {
namespace {

constexpr KeyFrameId kNewest{Wall::kKeyframes - 1};

/// Median distance between the measured and the true difference of a point's sightings in two
/// keyframes: what all sightings of a point have in common does not count.
double scatter(const Wall& wall, bool aligned) {
  std::vector<double> errors;
  wall.map.for_each_point([&](const MapPoint& point) {
    std::vector<Eigen::Vector2d> differences;
    for (const Observation& o : point.observations) {
      const KeyFrame& keyframe = *wall.map.find(o.keyframe);
      const AlignedSighting* a = keyframe.aligned_at(o.index, point.id);
      if (aligned && a == nullptr) continue;
      const Keypoint& k = keyframe.frame->keypoints[o.index];
      const Eigen::Vector2d seen =
          aligned ? Eigen::Vector2d(a->u, a->v) : Eigen::Vector2d(k.x, k.y);
      Eigen::Vector2d truth;
      const Pose& T_cw = wall.truth[static_cast<std::size_t>(o.keyframe.value)];
      Eigen::Vector3d at = point.position;
      at.z() = Wall::kDistance;
      if (keyframe.frame->camera->project(T_cw * at, truth)) differences.push_back(seen - truth);
    }
    for (std::size_t i = 1; i < differences.size(); ++i) {
      errors.push_back((differences[i] - differences[0]).norm());
    }
  });
  std::sort(errors.begin(), errors.end());
  return errors.at(errors.size() / 2);
}

TEST(AlignKeyframes, SightingsOfAPointAgree) {
  Wall wall;
  const KeyframeAlignment done = align_keyframes(wall.map, kNewest);
  const std::size_t n_failed = done.counts[1] + done.counts[2] + done.counts[3] + done.counts[4];
  EXPECT_GT(done.n_patches, static_cast<int>(wall.map.n_points() * 6 / 10));
  EXPECT_GT(done.counts[0], 4 * n_failed);
  EXPECT_GT(scatter(wall, false), 0.5);
  EXPECT_LT(scatter(wall, true), 0.15);
}

TEST(AlignKeyframes, EachSightingIsTriedOnce) {
  Wall wall;
  align_keyframes(wall.map, kNewest);
  const KeyframeAlignment again = align_keyframes(wall.map, kNewest);
  EXPECT_EQ(again.counts, AlignmentCounts{});
  EXPECT_EQ(again.n_patches, 0);
}

TEST(AlignKeyframes, KeypointsStay) {
  Wall wall, before;
  align_keyframes(wall.map, kNewest);
  const auto& keypoints = wall.map.find(kNewest)->frame->keypoints;
  const auto& were = before.map.find(kNewest)->frame->keypoints;
  ASSERT_EQ(keypoints.size(), were.size());
  for (std::size_t i = 0; i < were.size(); ++i) {
    EXPECT_EQ(keypoints[i].x, were[i].x);
    EXPECT_EQ(keypoints[i].y, were[i].y);
  }
}

TEST(AlignKeyframes, PatchesAloneMoveNothing) {
  Wall wall;
  const KeyframeAlignment done = align_keyframes(wall.map, kNewest, true);
  EXPECT_GT(done.n_patches, 0);
  EXPECT_EQ(done.counts, AlignmentCounts{});
  EXPECT_TRUE(wall.map.find(kNewest)->aligned.empty());
}

TEST(AlignKeyframes, NothingHappensWithoutImages) {
  Wall wall;
  for (int k = 0; k < Wall::kKeyframes; ++k) {
    wall.map.find(KeyFrameId(k))->frame->images->release();
  }
  EXPECT_EQ(align_keyframes(wall.map, kNewest).n_patches, 0);
  EXPECT_EQ(align_keyframes(wall.map, KeyFrameId(99)).n_patches, 0);
}

TEST(AlignKeyframes, AReplacedPointTakesNoSightingOfAnother) {
  Wall wall;
  align_keyframes(wall.map, kNewest);
  const KeyFrame& newest = *wall.map.find(kNewest);
  std::size_t slot = 0;
  while (newest.aligned_at(slot, newest.map_points[slot]) == nullptr) ++slot;
  const MapPointId other = wall.map.add_point({0, 0, 3}, KeyFrameId(0), 0);
  wall.map.replace_point(newest.map_points[slot], other);
  EXPECT_EQ(newest.map_points[slot], other);
  EXPECT_EQ(newest.aligned_at(slot, other), nullptr);
}

TEST(AlignKeyframes, LocalAdjustmentIsMoreExactWithIt) {
  Wall corners, aligned;
  align_keyframes(aligned.map, kNewest);
  for (Wall* wall : {&corners, &aligned}) {
    ASSERT_TRUE(local_bundle_adjustment(wall->map, kNewest, nullptr, false, 1,
                                        BundleSolver::kBlocks, nullptr, true)
                    .committed);
  }
  EXPECT_LT(aligned.largest_error(), 0.7 * corners.largest_error());
  // Corners in the right images limit it; the noise of the left ones was measured.
  EXPECT_EQ(aligned.map.noise().position.n_measured(), 1);
  EXPECT_EQ(corners.map.noise().position.n_measured(), 0);
}

TEST(AlignKeyframes, RepeatedRunsGiveTheSameBytes) {
  Wall first, second;
  for (Wall* wall : {&first, &second}) {
    align_keyframes(wall->map, kNewest, false, wall == &first ? 1 : 2);
    local_bundle_adjustment(wall->map, kNewest, nullptr);
  }
  EXPECT_EQ(first.largest_error(), second.largest_error());
}

/// The newest keyframe as a frame that is tracked in the others' map.
TrackedFrame tracked(const Wall& wall) {
  const KeyFrame& newest = *wall.map.find(kNewest);
  TrackedFrame frame(newest.frame);
  frame.T_cw = newest.T_cw;
  for (std::size_t i = 0; i < newest.map_points.size(); ++i) {
    const MapPoint* point = wall.map.find(newest.map_points[i]);
    if (point == nullptr || point->patch == nullptr) continue;
    Eigen::Vector3d at = point->position;
    at.z() = Wall::kDistance;
    frame.associate(i, point->id, at);
  }
  return frame;
}

TEST(AlignFrame, TakesTheWantedNumberOfInliers) {
  Wall wall;
  align_keyframes(wall.map, KeyFrameId(0), true);
  TrackedFrame frame = tracked(wall);
  ASSERT_GT(frame.n_associated(), 40U);
  const AlignmentCounts counts = align_frame(wall.map, frame, 20);
  EXPECT_EQ(counts[0] + counts[1] + counts[2] + counts[3] + counts[4], 20U);
  std::size_t n = 0;
  for (std::size_t i = 0; i < frame.map_points.size(); ++i) n += frame.aligned_at(i) != nullptr;
  EXPECT_EQ(n, counts[0]);
  frame.clear_associations();
  for (std::size_t i = 0; i < frame.map_points.size(); ++i) {
    EXPECT_EQ(frame.aligned_at(i), nullptr);
  }
}

TEST(AlignFrame, NoInlierIsLost) {
  Wall wall;
  align_keyframes(wall.map, KeyFrameId(0), true);
  TrackedFrame frame = tracked(wall);
  const int before = optimize_pose(frame).n_inliers;
  wall.map.noise().position.assume(0.1);
  wall.map.noise().right.assume(0.1);
  align_frame(wall.map, frame, 1000);
  EXPECT_GE(optimize_pose(frame).n_inliers, before - 2);
}

TEST(OptimizeAligned, OptimizesAgainWhereThePoseHasEnoughInliers) {
  Wall wall;
  align_keyframes(wall.map, KeyFrameId(0), true);
  TrackedFrame by_hand = tracked(wall), aligned = tracked(wall), plain = tracked(wall);
  const int n = optimize_pose(by_hand).n_inliers;
  const Pose without = *by_hand.T_cw;
  align_frame(wall.map, by_hand, 200);
  const PoseEstimate expected = optimize_pose(by_hand);

  const PoseEstimate estimate = optimize_aligned(wall.map, aligned, 200, n);
  EXPECT_EQ(estimate.n_inliers, expected.n_inliers);
  EXPECT_EQ(estimate.covariance, expected.covariance);
  EXPECT_EQ(aligned.T_cw->matrix(), by_hand.T_cw->matrix());
  EXPECT_NE(aligned.T_cw->matrix(), without.matrix());

  EXPECT_EQ(optimize_aligned(wall.map, plain, 200, n + 1).n_inliers, n);
  EXPECT_EQ(plain.T_cw->matrix(), without.matrix());
  TrackedFrame none = tracked(wall);
  optimize_aligned(wall.map, none, 0, 0);
  EXPECT_EQ(none.T_cw->matrix(), without.matrix());
}

TEST(AlignKeyframes, TheAssumedNoiseGivesTheWeights) {
  Wall wall;
  align_keyframes(wall.map, kNewest);
  wall.map.noise().position.assume(0.5);
  wall.map.noise().right.assume(0.5);
  const GatheredBundle bundle = gather_full_bundle(wall.map);
  std::size_t n_aligned = 0;
  for (std::size_t i = 0; i < bundle.kinds.size(); ++i) {
    // All keypoints are on level 0, where a corner has the weight 1.
    const auto& o = bundle.problem.observations[i];
    if (bundle.kinds[i] != ObservationKind::kAligned) continue;
    EXPECT_NEAR(o.inverse_sigma2, 4, 1e-4);
    EXPECT_NEAR(o.inverse_sigma2 * o.right_factor, 1, 1e-4);
    ++n_aligned;
  }
  EXPECT_GT(n_aligned, bundle.kinds.size() / 3);
}

TEST(NoiseFactor, BeginsAtACornerAndFollowsMeasurementsSlowly) {
  NoiseFactor noise;
  EXPECT_EQ(noise.value(), 1);
  EXPECT_EQ(noise.weight(), 1);
  noise.measure(std::nan(""));
  noise.measure(-1);
  EXPECT_EQ(noise.n_measured(), 0);
  EXPECT_EQ(noise.value(), 1);
  noise.measure(0.1);
  EXPECT_NEAR(noise.value(), std::pow(0.1, 1 / 20.0), 1e-9);
  for (int i = 0; i < 300; ++i) noise.measure(0.1);
  EXPECT_NEAR(noise.value(), 0.1, 1e-5);
  EXPECT_NEAR(noise.weight(), 100, 0.02);
  for (int i = 0; i < 300; ++i) noise.measure(5);  // an aligned sighting is never worse
  EXPECT_NEAR(noise.value(), 1, 1e-5);
  noise.forget();
  EXPECT_EQ(noise.n_measured(), 0);
  EXPECT_EQ(noise.value(), 1);
}

}  // namespace
}  // namespace orbslam::testing
