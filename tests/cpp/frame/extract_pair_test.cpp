// SPDX-License-Identifier: BSD-3-Clause
#include "frame/extract_pair.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <opencv2/core.hpp>

#include "base/errors.hpp"
#include "support/npy.hpp"

namespace orbslam {
namespace {

cv::Mat golden_image(const char* side) {
  const auto pixels = testing::read_npy<std::uint8_t>(
      testing::test_data(std::string("golden/stereo_synth/") + side + ".npy"));
  const cv::Mat view(static_cast<int>(pixels.rows()), static_cast<int>(pixels.columns()), CV_8UC1,
                     const_cast<std::uint8_t*>(pixels.values.data()));
  return view.clone();
}

void expect_equal(const Extraction& a, const Extraction& b) {
  ASSERT_EQ(a.features.size(), b.features.size());
  ASSERT_GT(a.features.size(), 0U);
  EXPECT_EQ(std::memcmp(a.features.keypoints.data(), b.features.keypoints.data(),
                        a.features.size() * sizeof(Keypoint)),
            0);
  EXPECT_EQ(a.features.descriptors, b.features.descriptors);
  ASSERT_EQ(a.pyramid.levels.size(), b.pyramid.levels.size());
  for (std::size_t level = 0; level < a.pyramid.levels.size(); ++level) {
    EXPECT_EQ(cv::norm(a.pyramid.levels[level], b.pyramid.levels[level], cv::NORM_INF), 0);
  }
}

class ExtractPair : public ::testing::Test {
 protected:
  OrbExtractor left_{OrbOptions{}}, right_{OrbOptions{}};
  WorkerThread helper_;
  cv::Mat left_image_ = golden_image("left"), right_image_ = golden_image("right");
};

TEST_F(ExtractPair, EqualsOneAfterTheOther) {
  OrbExtractor alone{OrbOptions{}};
  const Extraction left = alone.extract(left_image_);
  const Extraction right = alone.extract(right_image_);
  for (int round = 0; round < 3; ++round) {
    const auto pair = extract_pair(left_, right_, helper_, left_image_, right_image_);
    expect_equal(pair.first, left);
    expect_equal(pair.second, right);
  }
}

TEST_F(ExtractPair, MasksGoToTheirSides) {
  cv::Mat mask(left_image_.size(), CV_8UC1, cv::Scalar(255));
  mask.colRange(0, 320).setTo(0);
  const auto pair = extract_pair(left_, right_, helper_, left_image_, right_image_, {}, mask);
  expect_equal(pair.first, left_.extract(left_image_));
  expect_equal(pair.second, right_.extract(right_image_, mask));
}

TEST_F(ExtractPair, ExceptionsOfEitherSideArriveAndTheNextPairWorks) {
  cv::Mat wrong;
  left_image_.convertTo(wrong, CV_32F);
  EXPECT_THROW(extract_pair(left_, right_, helper_, wrong, right_image_), ImageError);
  EXPECT_THROW(extract_pair(left_, right_, helper_, left_image_, wrong), ImageError);
  EXPECT_THROW(extract_pair(left_, right_, helper_, wrong, wrong), ImageError);
  const auto pair = extract_pair(left_, right_, helper_, left_image_, right_image_);
  expect_equal(pair.second, right_.extract(right_image_));
}

TEST_F(ExtractPair, AnExtractorForPairsGivesTheSame) {
  PairExtractor extractor{OrbOptions{}};
  const auto pair = extractor.extract(left_image_, right_image_);
  expect_equal(pair.first, left_.extract(left_image_));
  expect_equal(pair.second, right_.extract(right_image_));
}

TEST_F(ExtractPair, SizesMustAgreeAndExtractorsDiffer) {
  EXPECT_THROW(
      extract_pair(left_, right_, helper_, left_image_, right_image_(cv::Rect(0, 0, 300, 300))),
      ImageError);
  EXPECT_THROW(extract_pair(left_, left_, helper_, left_image_, right_image_), StateError);
}

}  // namespace
}  // namespace orbslam
