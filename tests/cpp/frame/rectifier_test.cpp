// SPDX-License-Identifier: BSD-3-Clause
#include "frame/rectifier.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include "base/errors.hpp"

namespace orbslam {
namespace {

constexpr ImageSize kRawSize{320, 240};
const Pinhole kRectified{180, 180, 155, 118};

CameraModel fisheye() {
  return {"kannala_brandt", {190, 191, 158, 121, -0.03, 0.01, 0, 0}, kRawSize};
}

CameraModel distorted() {
  return {"radtan4", {230, 228, 163, 117, -0.28, 0.07, 0.001, -0.0005}, kRawSize};
}

Eigen::Matrix3d turned(double x, double y, double z) {
  return (Eigen::AngleAxisd(x, Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(y, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(z, Eigen::Vector3d::UnitZ()))
      .toRotationMatrix();
}

/// A smooth image whose grey values tell the pixel.
cv::Mat smooth_image() {
  cv::Mat image(kRawSize.height, kRawSize.width, CV_8UC1);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      image.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(20 + u / 2.0 + v / 4.0);
    }
  }
  return image;
}

TEST(Rectifier, KeepsTheBytesOfAPinholeThatIsRectifiedAlready) {
  const CameraModel raw("pinhole", {180, 180, 155, 118}, kRawSize);
  const Rectifier rectifier(raw, Eigen::Matrix3d::Identity(), kRectified, kRawSize);
  const cv::Mat image = smooth_image();
  EXPECT_EQ(cv::norm(rectifier.rectify(image), image, cv::NORM_INF), 0);
}

TEST(Rectifier, ShowsInEachPixelWhatTheRawCameraSeesInThatDirection) {
  const cv::Mat image = smooth_image();
  for (const CameraModel& raw : {fisheye(), distorted()}) {
    const Eigen::Matrix3d R = turned(0.02, -0.03, 0.01);
    const Rectifier rectifier(raw, R, kRectified, {300, 220});
    const cv::Mat rectified = rectifier.rectify(image);
    ASSERT_EQ(rectified.size(), cv::Size(300, 220));
    for (int v = 20; v < 200; v += 30) {
      for (int u = 20; u < 280; u += 30) {
        Seen seen;
        ASSERT_TRUE(raw.project(R.transpose() * kRectified.unproject(u, v, 3), seen));
        EXPECT_NEAR((rectifier.to_raw({u, v}) - seen.uv).norm(), 0, 1e-9);
        const double expected = 20 + seen.uv.x() / 2 + seen.uv.y() / 4;
        EXPECT_NEAR(rectified.at<std::uint8_t>(v, u), expected, 1.1) << u << " " << v;
      }
    }
  }
}

TEST(Rectifier, GivesTheBytesOfOpenCvAlsoAtBordersAndForColours) {
  cv::Mat grey(kRawSize.height, kRawSize.width, CV_8UC1);
  cv::randu(grey, 0, 256);
  cv::Mat colour;
  cv::merge(std::vector<cv::Mat>{grey, grey, grey}, colour);
  for (const double turn : {0.0, 0.5}) {  // of the second much is black
    const Rectifier rectifier(distorted(), turned(0.05, turn, 0.02), kRectified, {317, 233});
    std::vector<cv::Mat> channels;
    cv::split(rectifier.rectify(colour), channels);  // by cv::remap
    EXPECT_EQ(cv::norm(rectifier.rectify(grey), channels[1], cv::NORM_INF), 0);
  }
}

TEST(Rectifier, TurnsBackWhatItTurns) {
  const Rectifier rectifier(fisheye(), turned(0.1, 0.05, -0.02), kRectified, kRawSize);
  const Eigen::Vector2d raw(101.5, 77.25);
  EXPECT_NEAR((rectifier.to_raw(rectifier.from_raw(raw)) - raw).norm(), 0, 1e-7);
}

TEST(PairRectifier, PutsAPointOnOneRowAndGivesItsDisparity) {
  // The right camera stands 0.2 m to the right, both are turned against the rectified axes.
  const Eigen::Matrix3d R_left = turned(0.02, -0.01, 0.03), R_right = turned(-0.01, 0.04, -0.02);
  const Rectifier left(distorted(), R_left, kRectified, kRawSize);
  const Rectifier right(fisheye(), R_right, kRectified, kRawSize);
  const Eigen::Vector3d p(0.3, -0.2, 2.5);  // in rectified left coordinates
  Seen in_left, in_right;
  ASSERT_TRUE(left.raw().project(R_left.transpose() * p, in_left));
  ASSERT_TRUE(
      right.raw().project(R_right.transpose() * (p - Eigen::Vector3d(0.2, 0, 0)), in_right));
  const Eigen::Vector2d a = left.from_raw(in_left.uv), b = right.from_raw(in_right.uv);
  EXPECT_NEAR(a.y(), b.y(), 1e-6);
  EXPECT_NEAR(a.x() - b.x(), 180 * 0.2 / 2.5, 1e-6);
}

TEST(PairRectifier, GivesTheSameAsOneAfterTheOther) {
  const Rectifier left(distorted(), turned(0.02, 0, 0), kRectified, kRawSize);
  const Rectifier right(fisheye(), turned(0, 0.02, 0), kRectified, kRawSize);
  PairRectifier pair(left, right);
  const cv::Mat image = smooth_image();
  for (int repeat = 0; repeat < 3; ++repeat) {
    const auto both = pair.rectify(image, image);
    EXPECT_EQ(cv::norm(both.first, left.rectify(image), cv::NORM_INF), 0);
    EXPECT_EQ(cv::norm(both.second, right.rectify(image), cv::NORM_INF), 0);
  }
  EXPECT_THROW(pair.rectify(image, cv::Mat(10, 10, CV_8UC1)), ImageError);
  EXPECT_NO_THROW(pair.rectify(image, image));
}

TEST(Rectifier, KeepsMasksAtTwoValuesAndIsBlackWhereNothingIsSeen) {
  const Rectifier rectifier(distorted(), turned(0, 0.4, 0), kRectified, kRawSize);
  cv::Mat mask(kRawSize.height, kRawSize.width, CV_8UC1, cv::Scalar(255));
  mask(cv::Rect(100, 100, 40, 40)).setTo(0);
  const cv::Mat rectified = rectifier.rectify(mask, true);
  EXPECT_EQ(cv::countNonZero((rectified != 0) & (rectified != 255)), 0);
  EXPECT_EQ(rectifier.rectify(smooth_image()).at<std::uint8_t>(120, 0), 0);
}

TEST(Rectifier, RefusesWhatCannotBeRectified) {
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  const auto make = [&](const Eigen::Matrix3d& R, const Pinhole& plane, ImageSize size) {
    return Rectifier(fisheye(), R, plane, size);
  };
  EXPECT_THROW(make(2 * I, kRectified, kRawSize), SettingsError);
  EXPECT_THROW(make(I, {0, 180, 155, 118}, kRawSize), SettingsError);
  EXPECT_THROW(make(I, kRectified, {0, 240}), SettingsError);
  EXPECT_THROW(make(turned(0, 3.1, 0), kRectified, kRawSize), SettingsError);
  EXPECT_THROW(make(I, kRectified, kRawSize).rectify(cv::Mat(240, 321, CV_8UC1)), ImageError);
}

}  // namespace
}  // namespace orbslam
