// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/sighting_alignment.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "base/errors.hpp"
#include "optimize/textured_wall.hpp"

namespace orbslam::testing {
namespace {

TEST(SightingAlignment, SightingsAgreeAfterwards) {
  Wall wall;
  SightingAlignment alignment(wall.map);
  const double before = alignment.median_error();
  wall.align(alignment, 2);
  EXPECT_LT(alignment.median_error(), 0.1);
  EXPECT_GT(before, 0.3);
  ASSERT_TRUE(alignment.commit(wall.map).committed);
  EXPECT_LT(wall.largest_error(), 2e-3);

  const AlignmentCounts counts = alignment.counts();
  const std::size_t n_sightings = alignment.bundle().problem.observations.size();
  const std::size_t n_tried = std::accumulate(counts.begin(), counts.end(), std::size_t{0});
  EXPECT_LE(n_tried, n_sightings - alignment.bundle().points.size());
  EXPECT_GT(counts[0], n_tried * 8 / 10);
  EXPECT_GT(alignment.right_counts()[0], counts[0]);  // those of references, too
  EXPECT_GT(alignment.noise().deviation, 0);
  EXPECT_LT(alignment.noise().deviation, 0.2);
}

/// The same without images: corners that scatter give worse poses.
TEST(SightingAlignment, PosesAreBetterThanThoseOfCorners) {
  Wall corners, aligned;
  SightingAlignment none(corners.map);
  none.solve({}, nullptr, 1);
  ASSERT_TRUE(none.commit(corners.map).committed);
  SightingAlignment alignment(aligned.map);
  aligned.align(alignment, 2, false);
  ASSERT_TRUE(alignment.commit(aligned.map).committed);
  EXPECT_LT(aligned.largest_error(), 0.5 * corners.largest_error());
}

TEST(SightingAlignment, DisparitiesStayWithoutRightImages) {
  Wall wall;
  SightingAlignment alignment(wall.map);
  const std::vector<BundleProblem::Observation> before = alignment.bundle().problem.observations;
  wall.align(alignment, 1, false);
  const auto& after = alignment.bundle().problem.observations;
  std::size_t n_moved = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_NEAR(after[i].u - after[i].right_u, before[i].u - before[i].right_u, 1e-4);
    // The weight of the right column is what it was.
    EXPECT_NEAR(after[i].inverse_sigma2 * after[i].right_factor, before[i].inverse_sigma2, 1e-4);
    n_moved += after[i].u != before[i].u ? 1 : 0;
  }
  EXPECT_EQ(n_moved, alignment.counts()[0]);
}

TEST(SightingAlignment, RepeatedRunsGiveTheSameBytes) {
  Wall first, second;
  for (Wall* wall : {&first, &second}) {
    SightingAlignment alignment(wall->map);
    wall->align(alignment, 1);
    ASSERT_TRUE(alignment.commit(wall->map).committed);
  }
  EXPECT_EQ(first.largest_error(), second.largest_error());
}

TEST(SightingAlignment, ImagesOfAnotherSizeAreRefused) {
  Wall wall;
  SightingAlignment alignment(wall.map);
  const cv::Mat small = wall.left[0](cv::Rect(0, 0, 100, 100));
  EXPECT_THROW(alignment.take_references(KeyFrameId(0), small), ImageError);
  EXPECT_THROW(alignment.align(KeyFrameId(0), wall.left[0], small), ImageError);
  EXPECT_THROW(alignment.align(KeyFrameId(0), cv::Mat(), cv::Mat()), ImageError);
  EXPECT_THROW(alignment.take_references(KeyFrameId(99), wall.left[0]), StateError);
}

}  // namespace
}  // namespace orbslam::testing
