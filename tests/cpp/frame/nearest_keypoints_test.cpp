// SPDX-License-Identifier: BSD-3-Clause
#include "frame/nearest_keypoints.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/synthetic_frames.hpp"

namespace orbslam::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<std::uint32_t> nearest(const std::vector<float>& depths, std::size_t n_minimum) {
  std::vector<FeatureSpec> features(depths.size());
  for (std::size_t i = 0; i < depths.size(); ++i) {
    features[i].u = static_cast<float>(10 + i);
    features[i].v = 100;
    features[i].depth = depths[i];
  }
  std::vector<std::uint32_t> indices{99};  // what was there goes
  nearest_keypoints(*make_synthetic_frame(0, features), n_minimum, indices);
  return indices;
}

// The limit between close and far is 4 m.
TEST(NearestKeypoints, AllCloseOnesAndOneFarOne) {
  EXPECT_THAT(nearest({9, 1, 8, 2, 7}, 0), ElementsAre(1, 3, 4));
  EXPECT_THAT(nearest({9, 1, 8, 2, 7}, 2), ElementsAre(1, 3, 4));
  EXPECT_THAT(nearest({3, 1, 2}, 0), ElementsAre(1, 2, 0));
}

TEST(NearestKeypoints, FarOnesUpToTheMinimumAndOneMore) {
  EXPECT_THAT(nearest({9, 1, 8, 2, 7}, 3), ElementsAre(1, 3, 4, 2));
  EXPECT_THAT(nearest({9, 1, 8, 2, 7}, 4), ElementsAre(1, 3, 4, 2, 0));
  EXPECT_THAT(nearest({9, 1, 8, 2, 7}, SIZE_MAX), ElementsAre(1, 3, 4, 2, 0));
}

TEST(NearestKeypoints, TiesGoByIndexAndKeypointsWithoutDepthAreLeftOut) {
  EXPECT_THAT(nearest({2, -1, 2, 1, 2}, 100), ElementsAre(3, 0, 2, 4));
  EXPECT_THAT(nearest({-1, -1}, 100), IsEmpty());
  EXPECT_THAT(nearest({}, 100), IsEmpty());
}

}  // namespace
}  // namespace orbslam::testing
