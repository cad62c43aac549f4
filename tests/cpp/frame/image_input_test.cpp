// SPDX-License-Identifier: BSD-3-Clause
#include "frame/image_input.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/errors.hpp"

namespace orbslam {
namespace {

cv::Mat random_image(int type) {
  std::mt19937_64 generator(3);
  cv::Mat image(33, 47, type);
  for (std::size_t i = 0; i < image.total() * image.elemSize(); ++i) {
    image.data[i] = static_cast<std::uint8_t>(generator() & 255U);
  }
  return image;
}

TEST(ToGrey, GreyImagesShareTheirPixels) {
  const cv::Mat image = random_image(CV_8UC1);
  EXPECT_EQ(to_grey(image, true).data, image.data);
}

TEST(ToGrey, ColourOrderDecidesWhichChannelIsRed) {
  for (const int channels : {3, 4}) {
    const cv::Mat image = random_image(CV_8UC(channels));
    const cv::Mat rgb = to_grey(image, true), bgr = to_grey(image, false);
    ASSERT_EQ(rgb.type(), CV_8UC1);
    ASSERT_EQ(rgb.size(), image.size());
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        const std::uint8_t* p = image.ptr(y) + x * channels;
        EXPECT_NEAR(rgb.at<std::uint8_t>(y, x), 0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2], 0.51);
        EXPECT_NEAR(bgr.at<std::uint8_t>(y, x), 0.299 * p[2] + 0.587 * p[1] + 0.114 * p[0], 0.51);
      }
    }
  }
}

TEST(ToGrey, OtherImagesAreImageErrors) {
  for (const cv::Mat& image : {cv::Mat(), random_image(CV_8UC2), random_image(CV_16UC1),
                               cv::Mat(4, 4, CV_32FC3, cv::Scalar(1))}) {
    EXPECT_THROW(to_grey(image, true), ImageError);
    cv::Mat grey;
    EXPECT_THROW(to_grey(image, false, grey), ImageError);
  }
}

TEST(ToDepthMetres, RawUnitsAreDividedByTheFactor) {
  cv::Mat raw(2, 2, CV_16UC1);
  raw.at<std::uint16_t>(0, 0) = 5000;
  raw.at<std::uint16_t>(0, 1) = 0;
  raw.at<std::uint16_t>(1, 0) = 65535;
  raw.at<std::uint16_t>(1, 1) = 1;
  const cv::Mat metres = to_depth_metres(raw, 5000);
  ASSERT_EQ(metres.type(), CV_32FC1);
  EXPECT_FLOAT_EQ(metres.at<float>(0, 0), 1.0F);
  EXPECT_EQ(metres.at<float>(0, 1), 0.0F);
  EXPECT_FLOAT_EQ(metres.at<float>(1, 0), 13.107F);
  EXPECT_FLOAT_EQ(metres.at<float>(1, 1), 0.0002F);
}

TEST(ToDepthMetres, AnyNumericTypeWorks) {
  for (const int depth : {CV_8U, CV_8S, CV_16U, CV_16S, CV_32S, CV_32F, CV_64F}) {
    const cv::Mat metres = to_depth_metres(cv::Mat(3, 4, depth, cv::Scalar(50)), 100);
    ASSERT_EQ(metres.type(), CV_32FC1) << depth;
    EXPECT_FLOAT_EQ(metres.at<float>(2, 3), 0.5F) << depth;
    // Factor 1 still converts whatever is not float32.
    EXPECT_EQ(to_depth_metres(cv::Mat(3, 4, depth, cv::Scalar(50)), 1).type(), CV_32FC1);
  }
}

TEST(ToDepthMetres, MetresComeBackAsTheyAre) {
  cv::Mat metres(3, 4, CV_32FC1, cv::Scalar(2.5));
  metres.at<float>(0, 0) = NAN;
  metres.at<float>(0, 1) = -1.0F;
  for (const double factor : {1.0, 0.0, 1e-6, 1.000001}) {
    EXPECT_EQ(to_depth_metres(metres, factor).data, metres.data) << factor;
  }
  const cv::Mat halved = to_depth_metres(metres, 2);
  EXPECT_TRUE(std::isnan(halved.at<float>(0, 0)));
  EXPECT_EQ(halved.at<float>(0, 1), -0.5F);
  EXPECT_EQ(halved.at<float>(2, 2), 1.25F);
}

TEST(ToDepthMetres, GivenMemoryIsReused) {
  cv::Mat memory(3, 4, CV_32FC1);
  const auto* data = memory.data;
  to_depth_metres(cv::Mat(3, 4, CV_16UC1, cv::Scalar(7)), 7, memory);
  EXPECT_EQ(memory.data, data);
  EXPECT_FLOAT_EQ(memory.at<float>(1, 1), 1.0F);
}

TEST(ToDepthMetres, WrongInputIsRefused) {
  EXPECT_THROW(to_depth_metres(cv::Mat(), 1), ImageError);
  EXPECT_THROW(to_depth_metres(cv::Mat(3, 4, CV_16UC3), 1), ImageError);
  const cv::Mat raw(3, 4, CV_16UC1, cv::Scalar(1));
  EXPECT_THROW(to_depth_metres(raw, -5000), SettingsError);
  EXPECT_THROW(to_depth_metres(raw, NAN), SettingsError);
}

}  // namespace
}  // namespace orbslam
