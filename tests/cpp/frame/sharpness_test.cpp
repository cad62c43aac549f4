// SPDX-License-Identifier: BSD-3-Clause
#include "frame/sharpness.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <opencv2/imgproc.hpp>
#include <random>

#include "features/orb_extractor.hpp"
#include "frame/build_frame.hpp"

namespace orbslam {
namespace {

cv::Mat texture() {
  std::mt19937_64 generator(5);
  cv::Mat image(240, 320, CV_8UC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) image.at<std::uint8_t>(y, x) = generator() & 255U;
  }
  cv::GaussianBlur(image, image, {0, 0}, 1.5);
  cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
  return image;
}

std::shared_ptr<const Frame> frame_of(const cv::Mat& image, int n_features = 1000) {
  CameraOptions options;
  options.pinhole = {300, 300, 160, 120};
  options.image_size = {320, 240};
  OrbOptions orb;
  orb.n_features = n_features;
  OrbExtractor extractor{orb};
  const FrameContext context{std::make_shared<Camera>(options),
                             std::make_shared<ScalePyramid>(extractor.scales())};
  return build_monocular_frame(context, 0, 0, extractor.extract(image).features);
}

constexpr int kFeatures = 1000;

double sharpness_of(const cv::Mat& image) { return sharpness(*frame_of(image), kFeatures); }

TEST(Sharpness, FallsWithEveryBlur) {
  const cv::Mat image = texture();
  double last = sharpness_of(image);
  EXPECT_GT(last, 1000);
  for (const int length : {5, 11, 21}) {
    cv::Mat blurred;
    cv::blur(image, blurred, {length, 1});
    const double next = sharpness_of(blurred);
    EXPECT_LT(next, 0.85 * last) << length;
    last = next;
  }
}

TEST(Sharpness, WithoutCornersItIsZero) {
  EXPECT_EQ(sharpness_of(cv::Mat(240, 320, CV_8UC1, cv::Scalar(90))), 0);
}

TEST(Sharpness, OfMoreFeaturesTheShareOfTheStrongestFineOnesCounts) {
  Frame frame;
  for (const int response : {30, 7, 90, 7, 50, 20, 60, 10}) {
    frame.keypoints.emplace_back();
    frame.keypoints.back().level = 1;
    frame.keypoints.back().response = static_cast<float>(response);
  }
  for (int i = 0; i < 4; ++i) {
    frame.keypoints.emplace_back();
    frame.keypoints.back().level = 3;
    frame.keypoints.back().response = 200;
  }
  EXPECT_EQ(sharpness(frame, 12), 274);
  EXPECT_EQ(sharpness(frame, 6), 90 + 60 + 50 + 30) << "four of eight, as six are of twelve";
  EXPECT_EQ(sharpness(frame, 1), 0) << "less than one";
}

TEST(Sharpness, MoreFeaturesMakeNoImageSharper) {
  const cv::Mat image = texture();
  constexpr int n_usual = 200;
  const auto usual = frame_of(image, n_usual);
  const auto more = frame_of(image, 2 * n_usual);
  ASSERT_GT(more->size(), 1.8 * n_usual);
  const double expected = sharpness(*usual, n_usual);
  EXPECT_GT(sharpness(*more, 2 * n_usual), 1.5 * expected) << "all of them";
  EXPECT_NEAR(sharpness(*more, n_usual), expected, 0.3 * expected);
  cv::Mat blurred;
  cv::blur(image, blurred, {11, 1});
  EXPECT_LT(sharpness(*frame_of(blurred, 2 * n_usual), n_usual), 0.7 * expected);
}

TEST(Sharpness, OfFewerCornersThanUsualAllCount) {
  const auto frame = frame_of(texture(), 200);
  EXPECT_EQ(sharpness(*frame, frame->size()), sharpness(*frame, 10'000));
  EXPECT_EQ(sharpness(*frame, 0), 0);
}

TEST(FineDetail, FallsWithEveryBlurAndNotWithContrast) {
  const cv::Mat image = texture();
  const double sharp = fine_detail(*frame_of(image));
  cv::Mat darker;
  image.convertTo(darker, CV_8UC1, 0.6, 20);
  EXPECT_NEAR(fine_detail(*frame_of(darker)), sharp, 0.15 * sharp);
  double last = sharp;
  for (const int length : {5, 11, 21}) {
    cv::Mat blurred;
    cv::blur(image, blurred, {length, 1});
    const double next = fine_detail(*frame_of(blurred));
    EXPECT_LT(next, 0.9 * last) << length;
    last = next;
  }
}

TEST(FineDetail, WithoutCornersItIsZero) {
  EXPECT_EQ(fine_detail(*frame_of(cv::Mat(240, 320, CV_8UC1, cv::Scalar(90)))), 0);
}

}  // namespace
}  // namespace orbslam
