// SPDX-License-Identifier: BSD-3-Clause
#include "frame/stereo_matching.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "base/errors.hpp"
#include "features/level_placement.hpp"
#include "frame/stereo_pair.hpp"

namespace orbslam {
namespace {

using testing::read_extraction;
using testing::read_npy;
using testing::resized_pyramid;
using testing::test_data;

const ScalePyramid& scales() {
  static const ScalePyramid tables(1.2F, 8);
  return tables;
}

// Smooth noise: every 11x11 window looks different.
cv::Mat random_texture(int width, int height, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  cv::Mat image(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) image.at<std::uint8_t>(y, x) = generator() & 255U;
  }
  cv::GaussianBlur(image, image, {0, 0}, 2.0);
  cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
  return image;
}

// Keypoints on a grid of one level with random, hence unmistakable, descriptors. The right image
// shows everything `shift` level-0 pixels further left.
struct ShiftedPair {
  Extraction left, right;
};

ShiftedPair shifted_pair(int shift, int level = 0) {
  const int width = 400, height = 240;
  const cv::Mat texture = random_texture(width + shift, height, 5);
  ShiftedPair pair;
  pair.left.pyramid = resized_pyramid(texture(cv::Rect(0, 0, width, height)).clone(), scales());
  pair.right.pyramid =
      resized_pyramid(texture(cv::Rect(shift, 0, width, height)).clone(), scales());
  std::mt19937_64 generator(6);
  const float scale = scales().scale(level);
  const LevelPlacement placement(scales(), level, {width, height});
  const int first = 20;
  for (int y = first; static_cast<float>(y) * scale < static_cast<float>(height) - 20 * scale;
       y += 20) {
    for (int x = first; static_cast<float>(x) * scale < static_cast<float>(width) - 20 * scale;
         x += 20) {
      Keypoint keypoint;
      keypoint.x = placement.x.to_image(static_cast<float>(x));
      keypoint.y = placement.y.to_image(static_cast<float>(y));
      keypoint.level = level;
      Descriptor descriptor;
      for (auto& word : descriptor.words) word = generator();
      pair.left.features.keypoints.push_back(keypoint);
      pair.left.features.descriptors.push_back(descriptor);
      keypoint.x -= static_cast<float>(shift);
      pair.right.features.keypoints.push_back(keypoint);
      pair.right.features.descriptors.push_back(descriptor);
    }
  }
  return pair;
}

int count_matched(const StereoMatches& matches) {
  return static_cast<int>(
      std::count_if(matches.depth.begin(), matches.depth.end(), [](float z) { return z > 0; }));
}

TEST(StereoMatching, EqualsTheGoldenPairBitByBit) {
  const std::string folder = test_data("golden/stereo_synth");
  const ScalePyramid original(1.2F, 8, true);
  const Extraction left = read_extraction(folder, "left", 8, original);
  const Extraction right = read_extraction(folder, "right", 8, original);
  const auto k_bf = read_npy<float>(folder + "/K_bf.npy").values;
  const StereoMatches matches = match_stereo(left, right, original, k_bf[4], k_bf[0]);
  EXPECT_EQ(matches.right_u, read_npy<float>(folder + "/uRight.npy").values);
  EXPECT_EQ(matches.depth, read_npy<float>(folder + "/depth.npy").values);
}

TEST(StereoMatching, IntegerShiftsAreFoundToHalfAPixelOfTheLevel) {
  for (const int level : {0, 2, 5}) {
    for (const int shift : {6, 18, 36}) {
      const ShiftedPair pair = shifted_pair(shift, level);
      const StereoMatches matches = match_stereo(pair.left, pair.right, scales(), 40, 300);
      int found = 0;
      for (std::size_t i = 0; i < matches.depth.size(); ++i) {
        if (!(matches.depth[i] > 0)) continue;
        ++found;
        const float disparity = pair.left.features.keypoints[i].x - matches.right_u[i];
        // Half a pixel of the parabola, as much again for resampling on the higher levels.
        const float tolerance = (level == 0 ? 0.5F : 1.0F) * scales().scale(level);
        EXPECT_NEAR(disparity, static_cast<float>(shift), tolerance);
        EXPECT_FLOAT_EQ(matches.depth[i], 40.0F / disparity);
      }
      EXPECT_GT(found, static_cast<int>(matches.depth.size()) / 2) << level << " " << shift;
    }
  }
}

// OD-30: a limit of 0 removes no match. OD-31: the sliding window stays within the image on the
// left.
TEST(StereoMatching, EqualWindowsAreNeverAnOutlier) {
  // Without noise every window sum is 0, hence their median and with it the limit.
  const ShiftedPair pair = shifted_pair(16);
  const StereoMatches matches = match_stereo(pair.left, pair.right, scales(), 40, 300);
  int expected = 0;
  for (const Keypoint& keypoint : pair.right.features.keypoints) {
    if (keypoint.x >= 10 && keypoint.x + 11 < 400) ++expected;
  }
  ASSERT_GT(expected, 100);
  EXPECT_EQ(count_matched(matches), expected);
}

TEST(StereoMatching, SpoiledWindowsAreRemovedButTheEqualOnesStay) {
  ShiftedPair pair = shifted_pair(16);
  const StereoMatches clean = match_stereo(pair.left, pair.right, scales(), 40, 300);
  // Invert one keypoint's surroundings in the right image.
  const std::size_t spoiled = 30;
  const Keypoint& keypoint = pair.right.features.keypoints[spoiled];
  ASSERT_GT(clean.depth[spoiled], 0);
  cv::Mat patch = pair.right.pyramid.levels[0](
      cv::Rect(static_cast<int>(keypoint.x) - 9, static_cast<int>(keypoint.y) - 9, 19, 19));
  cv::bitwise_not(patch, patch);
  const StereoMatches matches = match_stereo(pair.left, pair.right, scales(), 40, 300);
  EXPECT_EQ(matches.depth[spoiled], -1.0F);
  EXPECT_EQ(matches.right_u[spoiled], -1.0F);
  EXPECT_EQ(count_matched(matches), count_matched(clean) - 1);
}

TEST(StereoMatching, DisparityZeroBecomesAHundredthOfAPixel) {
  ShiftedPair pair = shifted_pair(0);
  // A symmetric dip around shift 0: constant image but for one column.
  for (Extraction* side : {&pair.left, &pair.right}) {
    cv::Mat image(240, 400, CV_8UC1, cv::Scalar(100));
    image.col(200).setTo(250);
    side->pyramid = resized_pyramid(image, scales());
  }
  const StereoMatches matches = match_stereo(pair.left, pair.right, scales(), 40, 300);
  int found = 0;
  for (std::size_t i = 0; i < matches.depth.size(); ++i) {
    if (pair.left.features.keypoints[i].x != 200.0F) continue;
    ++found;
    EXPECT_FLOAT_EQ(matches.right_u[i], 199.99F);
    EXPECT_FLOAT_EQ(matches.depth[i], 4000.0F);
  }
  EXPECT_EQ(found, 10);
}

TEST(StereoMatching, RightOfTheLeftColumnOrTooCloseIsNoCandidate) {
  const ShiftedPair pair = shifted_pair(16);
  EXPECT_EQ(count_matched(match_stereo(pair.right, pair.left, scales(), 40, 300)), 0);
  EXPECT_EQ(count_matched(match_stereo(pair.left, pair.right, scales(), 40, 15.5)), 0);
}

TEST(StereoMatching, LevelsMoreThanOneApartDoNotMatch) {
  ShiftedPair pair = shifted_pair(16);
  for (Keypoint& keypoint : pair.right.features.keypoints) keypoint.level = 1;
  EXPECT_GT(count_matched(match_stereo(pair.left, pair.right, scales(), 40, 300)), 0);
  for (Keypoint& keypoint : pair.right.features.keypoints) keypoint.level = 2;
  EXPECT_EQ(count_matched(match_stereo(pair.left, pair.right, scales(), 40, 300)), 0);
}

TEST(StereoMatching, DescriptorsMustDifferByLessThan75Bits) {
  ShiftedPair pair = shifted_pair(16);
  const auto flip = [](const Descriptor& original_bits, int bits) {
    Descriptor d = original_bits;
    for (int bit = 0; bit < bits; ++bit) d.words[bit / 64] ^= 1ULL << (bit % 64);
    return d;
  };
  const auto original = pair.right.features.descriptors;
  const int all = count_matched(match_stereo(pair.left, pair.right, scales(), 40, 300));
  for (std::size_t i = 0; i < original.size(); ++i) {
    pair.right.features.descriptors[i] = flip(original[i], 74);
  }
  EXPECT_EQ(count_matched(match_stereo(pair.left, pair.right, scales(), 40, 300)), all);
  for (std::size_t i = 0; i < original.size(); ++i) {
    pair.right.features.descriptors[i] = flip(original[i], 75);
  }
  EXPECT_EQ(count_matched(match_stereo(pair.left, pair.right, scales(), 40, 300)), 0);
}

// OD-28: rows outside of the image are clipped.
TEST(StereoMatching, KeypointsAtTheBorderAndASmallerRightImageAreSafe) {
  ShiftedPair pair = shifted_pair(16);
  auto& keypoints = pair.left.features.keypoints;
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    keypoints[i].y = i % 2 == 0 ? 0.0F : 239.0F;
    pair.right.features.keypoints[i].y = i % 3 == 0 ? 300.0F : keypoints[i].y;
  }
  keypoints[0].x = -1.0F;
  keypoints[1].y = -3.0F;
  keypoints[2].y = 240.0F;
  EXPECT_EQ(count_matched(match_stereo(pair.left, pair.right, scales(), 40, 300)), 0);

  ShiftedPair smaller = shifted_pair(16);
  smaller.right.pyramid =
      resized_pyramid(smaller.right.pyramid.levels[0](cv::Rect(0, 0, 200, 100)).clone(), scales());
  const StereoMatches matches = match_stereo(smaller.left, smaller.right, scales(), 40, 300);
  for (std::size_t i = 0; i < matches.depth.size(); ++i) {
    if (matches.depth[i] > 0) {
      EXPECT_LT(smaller.left.features.keypoints[i].y, 100);
      EXPECT_LT(matches.right_u[i], 200);
    }
  }
  EXPECT_GT(count_matched(matches), 0);
}

// OD-29: without any match there is no median.
TEST(StereoMatching, NoKeypointsOnEitherSide) {
  ShiftedPair pair = shifted_pair(16);
  const std::size_t n = pair.left.features.size();
  pair.right.features = {};
  const StereoMatches none = match_stereo(pair.left, pair.right, scales(), 40, 300);
  EXPECT_EQ(none.right_u, std::vector<float>(n, -1.0F));
  EXPECT_EQ(none.depth, std::vector<float>(n, -1.0F));
  pair.left.features = {};
  EXPECT_TRUE(match_stereo(pair.left, pair.right, scales(), 40, 300).depth.empty());
}

TEST(StereoMatching, InconsistentInputIsAnImageError) {
  const ShiftedPair pair = shifted_pair(16);
  ShiftedPair wrong = pair;
  wrong.right.pyramid = {};
  EXPECT_THROW(match_stereo(wrong.left, wrong.right, scales(), 40, 300), ImageError);
  wrong = pair;
  wrong.left.features.keypoints[3].level = 8;
  EXPECT_THROW(match_stereo(wrong.left, wrong.right, scales(), 40, 300), ImageError);
  wrong = pair;
  wrong.left.features.descriptors.pop_back();
  EXPECT_THROW(match_stereo(wrong.left, wrong.right, scales(), 40, 300), ImageError);
  wrong = pair;
  wrong.right.pyramid.levels.pop_back();
  EXPECT_THROW(match_stereo(wrong.left, wrong.right, scales(), 40, 300), ImageError);
}

}  // namespace
}  // namespace orbslam
