// SPDX-License-Identifier: BSD-3-Clause
#include "features/orb_extractor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <thread>

#include "base/errors.hpp"
#include "features/images.hpp"
#include "features/level_placement.hpp"

namespace orbslam {
namespace {

using testing::random_image;
using testing::same_features;

OrbOptions options_of(int n_features) {
  OrbOptions options;
  options.n_features = n_features;
  return options;
}

TEST(OrbExtractor, SameImageGivesSameBytesForAnyNumberOfThreads) {
  const cv::Mat image = random_image(640, 480, 7);
  OrbExtractor extractor(options_of(1000));
  const int threads_before = cv::getNumThreads();
  cv::setNumThreads(1);
  const Extraction first = extractor.extract(image);
  cv::setNumThreads(4);
  extractor.extract(random_image(333, 444, 8));  // leftovers of another image must not matter
  const Extraction again = extractor.extract(image);
  cv::setNumThreads(threads_before);
  EXPECT_GT(first.features.size(), 900U);
  EXPECT_TRUE(same_features(first.features, again.features));
  EXPECT_TRUE(
      same_features(first.features, OrbExtractor(options_of(1000)).extract(image).features));
}

TEST(OrbExtractor, TwoExtractorsRunSideBySide) {
  const cv::Mat left = random_image(500, 300, 1), right = random_image(500, 300, 2);
  OrbExtractor left_extractor(options_of(500)), right_extractor(options_of(500));
  const Features left_alone = left_extractor.extract(left).features;
  const Features right_alone = right_extractor.extract(right).features;
  for (int repeat = 0; repeat < 5; ++repeat) {
    Features left_result, right_result;
    std::thread thread([&] { right_result = right_extractor.extract(right).features; });
    left_result = left_extractor.extract(left).features;
    thread.join();
    EXPECT_TRUE(same_features(left_result, left_alone));
    EXPECT_TRUE(same_features(right_result, right_alone));
  }
}

TEST(OrbExtractor, KeypointsKeepTheirDistanceAndTheirQuota) {
  for (const cv::Size& size : {cv::Size(640, 480), cv::Size(1241, 376), cv::Size(300, 260),
                               cv::Size(240, 720), cv::Size(400, 700)}) {
    for (const int n_features : {1, 50, 1000, 4000}) {
      OrbExtractor extractor(options_of(n_features));
      const Extraction result = extractor.extract(
          random_image(size.width, size.height, static_cast<std::uint64_t>(n_features)));
      const ScalePyramid& scales = extractor.scales();
      const std::vector<int> quota = scales.features_per_level(n_features);
      std::map<int, int> count;
      int last_level = 0;
      for (const Keypoint& keypoint : result.features.keypoints) {
        const cv::Mat& level = result.pyramid.levels[static_cast<std::size_t>(keypoint.level)];
        const float scale = scales.scale(keypoint.level);
        const LevelPlacement placement(scales, keypoint.level, {size.width, size.height});
        const float x = std::round(placement.x.to_level(keypoint.x));
        const float y = std::round(placement.y.to_level(keypoint.y));
        EXPECT_EQ(placement.x.to_image(x), keypoint.x);
        EXPECT_EQ(placement.y.to_image(y), keypoint.y);
        EXPECT_GE(std::min(x, y), 19);
        EXPECT_LE(x, level.cols - 20);
        EXPECT_LE(y, level.rows - 20);
        EXPECT_GE(keypoint.angle, 0);
        EXPECT_LT(keypoint.angle, 360);
        EXPECT_GE(keypoint.response, 7);
        EXPECT_EQ(keypoint.size, std::trunc(31 * scale));
        EXPECT_GE(keypoint.level, last_level);
        last_level = keypoint.level;
        ++count[keypoint.level];
      }
      for (const auto& [level, found] : count) {
        const cv::Mat& image = result.pyramid.levels[static_cast<std::size_t>(level)];
        const float aspect =
            static_cast<float>(image.cols - 32) / static_cast<float>(image.rows - 32);
        const int n_roots = std::max(1, static_cast<int>(std::round(aspect)));
        const int wanted = quota[static_cast<std::size_t>(level)];
        EXPECT_LE(found, std::max(wanted + 2, 4 * n_roots)) << size << " level " << level;
        EXPECT_GT(wanted, 0);  // a level without quota gives nothing
      }
    }
  }
}

// A ramp says of every pixel of every level where it comes from.
TEST(LevelPlacement, ALevelsPixelsLieWhereTheirGreyValuesComeFrom) {
  constexpr int kSlope = 4;  // grey levels a pixel: resizing rounds them down, by one in the end
  cv::Mat ramp(240, 240, CV_8UC1);
  for (int x = 0; x < ramp.cols; ++x) ramp.col(x) = cv::Scalar(std::min(255, kSlope * x));
  const ScalePyramid scales(1.2F, 8);
  const ImagePyramid pyramid = build_pyramid(ramp, scales);
  for (int level = 0; level < 8; ++level) {
    const cv::Mat& image = pyramid.levels[static_cast<std::size_t>(level)];
    const LevelPlacement placement(scales, level, {ramp.cols, ramp.rows});
    constexpr int kColumns = 12;  // further right the ramp ends
    float off = 0;
    for (int x = 1; x <= kColumns; ++x) {
      const float came_from = static_cast<float>(image.at<std::uint8_t>(10, x)) / kSlope;
      off += (placement.x.to_image(static_cast<float>(x)) - came_from) / kColumns;
    }
    EXPECT_NEAR(off, 0, 0.3) << level;
    EXPECT_FLOAT_EQ(placement.x.to_level(placement.x.to_image(21)), 21);
  }
}

// Sizes of levels are whole numbers: by the scale alone the far border would be off by over a
// pixel.
TEST(LevelPlacement, TheFarBordersOfALevelLieAtThoseOfTheImage) {
  const ScalePyramid scales(1.2F, 8);
  float farthest = 0;
  for (const ImageSize image : {ImageSize{640, 480}, ImageSize{1241, 376}, ImageSize{320, 240}}) {
    for (int level = 0; level < 8; ++level) {
      const ImageSize size = scales.level_size(image, level);
      const LevelPlacement placement(scales, level, image);
      const float right = static_cast<float>(size.width) - 0.5F;
      const float bottom = static_cast<float>(size.height) - 0.5F;
      EXPECT_NEAR(placement.x.to_image(right), static_cast<float>(image.width) - 0.5F, 1e-3);
      EXPECT_NEAR(placement.y.to_image(bottom), static_cast<float>(image.height) - 0.5F, 1e-3);
      EXPECT_NEAR(placement.x.to_image(-0.5F), -0.5F, 1e-6);
      farthest = std::max(farthest, std::abs((right + 0.5F) * scales.scale(level) -
                                             static_cast<float>(image.width)));
    }
  }
  EXPECT_GT(farthest, 1);
}

TEST(LevelPlacement, WhatLiesAtTheFarBorderIsFoundThereOnEveryLevel) {
  cv::Mat bar(120, 1241, CV_8UC1, cv::Scalar(0));
  bar.colRange(1190, 1206).setTo(240);
  constexpr float kMiddle = 1197.5F;
  const ScalePyramid scales(1.2F, 8);
  const ImagePyramid pyramid = build_pyramid(bar, scales);
  for (int level = 0; level < 8; ++level) {
    const cv::Mat& image = pyramid.levels[static_cast<std::size_t>(level)];
    float weights = 0, sum = 0;
    for (int x = 0; x < image.cols; ++x) {
      const float grey = image.at<std::uint8_t>(10, x);
      weights += grey;
      sum += grey * static_cast<float>(x);
    }
    const LevelPlacement placement(scales, level, {bar.cols, bar.rows});
    EXPECT_NEAR(placement.x.to_image(sum / weights), kMiddle, 0.2) << level;
  }
}

TEST(LevelPlacement, TheOriginalsIsAMultipleOfTheScale) {
  OrbOptions options = options_of(1000);
  const cv::Mat image = random_image(640, 480, 7);
  const Features here = OrbExtractor(options).extract(image).features;
  options.original_coordinates = true;
  OrbExtractor original(options);
  EXPECT_TRUE(original.scales().original_coordinates());
  const Features there = original.extract(image).features;
  ASSERT_EQ(here.size(), there.size());
  for (std::size_t i = 0; i < here.size(); ++i) {
    const float scale = original.scales().scale(here.keypoints[i].level);
    const ImageSize size = original.scales().level_size({640, 480}, here.keypoints[i].level);
    const float x = std::round(there.keypoints[i].x / scale);
    const float y = std::round(there.keypoints[i].y / scale);
    EXPECT_NEAR(here.keypoints[i].x, (x + 0.5F) * 640 / static_cast<float>(size.width) - 0.5F,
                1e-3);
    EXPECT_NEAR(here.keypoints[i].y, (y + 0.5F) * 480 / static_cast<float>(size.height) - 0.5F,
                1e-3);
    EXPECT_EQ(there.keypoints[i].x, scale * x);
    EXPECT_EQ(here.descriptors[i].words, there.descriptors[i].words);
  }
}

// OD-22: levels with less than 30 pixels to search in give nothing.
TEST(OrbExtractor, FlatAndTinyImagesGiveNothing) {
  OrbExtractor extractor(options_of(1000));
  EXPECT_EQ(extractor.extract(cv::Mat(480, 640, CV_8UC1, cv::Scalar(128))).features.size(), 0U);
  for (const cv::Size& size :
       {cv::Size(1, 1), cv::Size(1, 50), cv::Size(61, 200), cv::Size(200, 61)}) {
    const Extraction result = extractor.extract(random_image(size.width, size.height, 3));
    EXPECT_EQ(result.features.size(), 0U) << size;
    EXPECT_EQ(result.features.descriptors.size(), 0U);
    EXPECT_EQ(result.pyramid.levels.size(), 8U);
  }
  // The upper levels of 100 x 100 are too small, the lower ones are not.
  const Extraction small = extractor.extract(random_image(100, 100, 3));
  ASSERT_GT(small.features.size(), 0U);
  EXPECT_LT(small.features.keypoints.back().level, 3);
}

TEST(OrbExtractor, RotatedImageRotatesTheAngles) {
  const cv::Mat image =
      testing::read_image(testing::test_data("golden/extractor_synth7/image.npy"));
  cv::Mat rotated;
  cv::rotate(image, rotated, cv::ROTATE_90_CLOCKWISE);
  OrbOptions options = options_of(2000);
  options.n_levels = 1;
  OrbExtractor extractor(options);
  const Features upright = extractor.extract(image).features;
  const Features turned = extractor.extract(rotated).features;
  std::map<std::pair<float, float>, std::size_t> at;
  for (std::size_t i = 0; i < turned.size(); ++i) {
    at[{turned.keypoints[i].x, turned.keypoints[i].y}] = i;
  }
  int common = 0, close = 0;
  for (std::size_t i = 0; i < upright.size(); ++i) {
    const Keypoint& keypoint = upright.keypoints[i];
    const auto found = at.find({static_cast<float>(image.rows - 1) - keypoint.y, keypoint.x});
    if (found == at.end()) continue;
    ++common;
    const float turn = turned.keypoints[found->second].angle - keypoint.angle;
    EXPECT_NEAR(std::remainder(turn - 90, 360.0F), 0, 0.6);
    close += hamming_distance(turned.descriptors[found->second], upright.descriptors[i]) <= 40;
  }
  EXPECT_GT(common, 200);
  EXPECT_GT(close, common * 9 / 10);
}

TEST(OrbExtractor, BrighterLowerHalfPointsDown) {
  // A bright square on a dark ground: its upper left corner has the light to the lower right.
  cv::Mat image(120, 120, CV_8UC1, cv::Scalar(20));
  image(cv::Rect(60, 60, 60, 60)) = cv::Scalar(220);
  const Features features = OrbExtractor(options_of(100)).extract(image).features;
  ASSERT_GT(features.size(), 0U);
  EXPECT_NEAR(features.keypoints[0].angle, 45, 3);
  EXPECT_NEAR(features.keypoints[0].x, 60, 2);
  EXPECT_NEAR(features.keypoints[0].y, 60, 2);
}

TEST(OrbExtractor, WindowOfALargerImage) {
  const cv::Mat large = random_image(400, 300, 4);
  const cv::Mat window = large(cv::Rect(33, 21, 301, 203));
  OrbExtractor extractor(options_of(500));
  const Features seen = extractor.extract(window).features;
  EXPECT_TRUE(same_features(seen, extractor.extract(window.clone()).features));
}

TEST(OrbExtractorMask, NoKeypointOnForbiddenPixels) {
  const cv::Mat image = random_image(640, 480, 4);
  cv::Mat mask(480, 640, CV_8UC1, cv::Scalar(255));
  cv::circle(mask, {300, 200}, 120, cv::Scalar(0), cv::FILLED);
  mask(cv::Rect(500, 0, 3, 480)) = cv::Scalar(0);
  OrbExtractor extractor(options_of(1000));
  const Features features = extractor.extract(image, mask).features;
  for (const Keypoint& keypoint : features.keypoints) {
    for (const float x : {std::floor(keypoint.x), std::ceil(keypoint.x)}) {
      for (const float y : {std::floor(keypoint.y), std::ceil(keypoint.y)}) {
        EXPECT_NE(mask.at<std::uint8_t>(static_cast<int>(y), static_cast<int>(x)), 0);
      }
    }
  }
  // Applied before the distribution: the budget goes to what is left.
  EXPECT_GT(features.size(), 950U);
}

TEST(OrbExtractorMask, FullMaskChangesNothingAndEmptyOneForbidsAll) {
  const cv::Mat image = random_image(320, 240, 5);
  OrbExtractor extractor(options_of(500));
  const Features plain = extractor.extract(image).features;
  EXPECT_GT(plain.size(), 400U);
  EXPECT_TRUE(same_features(
      plain, extractor.extract(image, cv::Mat(240, 320, CV_8UC1, cv::Scalar(1))).features));
  EXPECT_EQ(extractor.extract(image, cv::Mat::zeros(240, 320, CV_8UC1)).features.size(), 0U);
}

// OD-24: empty images and wrong types of pixels are errors.
TEST(OrbExtractorErrors, BadImages) {
  OrbExtractor extractor(options_of(500));
  const cv::Mat good(100, 120, CV_8UC1, cv::Scalar(0));
  EXPECT_THROW(extractor.extract(cv::Mat()), ImageError);
  EXPECT_THROW(extractor.extract(cv::Mat(100, 120, CV_8UC3)), ImageError);
  EXPECT_THROW(extractor.extract(cv::Mat(100, 120, CV_32FC1)), ImageError);
  EXPECT_THROW(extractor.extract(cv::Mat(1, 40000, CV_8UC1)), ImageError);
  EXPECT_THROW(extractor.extract(good, cv::Mat(120, 100, CV_8UC1)), ImageError);
  EXPECT_THROW(extractor.extract(good, cv::Mat(100, 120, CV_8UC3)), ImageError);
  try {
    extractor.extract(good, cv::Mat(120, 100, CV_8UC1));
  } catch (const ImageError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("100x120"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("120x100"));
  }
}

TEST(OrbExtractorErrors, BadOptionsAreNamed) {
  const auto message_of = [](const OrbOptions& options) -> std::string {
    try {
      OrbExtractor extractor(options);
    } catch (const SettingsError& error) {
      return error.what();
    }
    return "accepted";
  };
  OrbOptions options;
  EXPECT_EQ(message_of(options), "accepted");
  options.n_features = 0;
  EXPECT_THAT(message_of(options), ::testing::HasSubstr("n_features"));
  options = {};
  options.n_levels = 17;
  EXPECT_THAT(message_of(options), ::testing::HasSubstr("n_levels"));
  options = {};
  options.scale_factor = 1.0F;
  EXPECT_THAT(message_of(options), ::testing::HasSubstr("scale factor"));
  options = {};
  options.scale_factor = std::nanf("");
  EXPECT_THAT(message_of(options), ::testing::HasSubstr("scale factor"));
  options = {};
  options.initial_threshold = 255;
  EXPECT_THAT(message_of(options), ::testing::HasSubstr("initial_threshold"));
  options = {};
  options.minimum_threshold = 0;
  EXPECT_THAT(message_of(options), ::testing::HasSubstr("minimum_threshold"));
  options = {};
  options.minimum_threshold = 21;
  EXPECT_THAT(message_of(options), ::testing::HasSubstr("must not exceed"));
}

}  // namespace
}  // namespace orbslam
