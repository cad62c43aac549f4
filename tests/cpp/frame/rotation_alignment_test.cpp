// SPDX-License-Identifier: BSD-3-Clause
#include "frame/rotation_alignment.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "support/cameras.hpp"

namespace orbslam {
namespace {

constexpr double kDegree = M_PI / 180;
const Camera kCamera = *testing::make_camera({400, 400, 319.5, 239.5});

/// Patches of random grey all around, seen by a camera that is turned by R_cw.
cv::Mat1b look(const Eigen::Matrix3d& R_cw, double gain = 1, double offset = 0) {
  cv::RNG random(4);
  cv::Mat1b sky(180, 360);
  random.fill(sky, cv::RNG::UNIFORM, 40, 180);
  cv::Mat1b image(480, 640);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const Eigen::Vector3d ray = R_cw.transpose() * kCamera.unproject(x, y, 1);
      const double across = std::atan2(ray.x(), ray.z()) / kDegree;
      const double down = std::atan2(ray.y(), std::hypot(ray.x(), ray.z())) / kDegree;
      const std::uint8_t patch =
          sky(static_cast<int>((down + 90) / 4), static_cast<int>((across + 180) / 4));
      image(y, x) = cv::saturate_cast<std::uint8_t>(gain * patch + offset);
    }
  }
  return image;
}

Eigen::Matrix3d turn(double yaw, double pitch, double roll) {
  return (Eigen::AngleAxisd(yaw * kDegree, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(pitch * kDegree, Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(roll * kDegree, Eigen::Vector3d::UnitZ()))
      .toRotationMatrix();
}

class RotationAlignment : public ::testing::TestWithParam<std::array<double, 3>> {};

TEST_P(RotationAlignment, FindsATurnWithinATenthOfAPatch) {
  const auto [yaw, pitch, roll] = GetParam();
  const Eigen::Matrix3d R_21 = turn(yaw, pitch, roll);
  const SmallImage first = shrink_image(look(Eigen::Matrix3d::Identity()));
  // Another exposure is no turn.
  const SmallImage second = shrink_image(look(R_21, 0.8, 10));
  const auto found = align_rotation(first, second, kCamera);
  ASSERT_TRUE(found);
  const double error = Eigen::AngleAxisd(found->R_21.toRotationMatrix() * R_21.transpose()).angle();
  EXPECT_LT(error / kDegree, 0.4);
  EXPECT_GT(found->correlation, 0.8);
}

INSTANTIATE_TEST_SUITE_P(Turns, RotationAlignment,
                         ::testing::Values(std::array{0.0, 0.0, 0.0}, std::array{4.0, 0.0, 0.0},
                                           std::array{-8.0, 1.0, 0.0}, std::array{12.0, 0.0, 0.0},
                                           std::array{0.0, 5.0, 0.0}, std::array{2.0, -3.0, 3.0}));

TEST(RotationAlignmentRefuses, WhatSaysNothing) {
  const SmallImage some = shrink_image(look(Eigen::Matrix3d::Identity()));
  const SmallImage flat = shrink_image(cv::Mat1b(480, 640, std::uint8_t{90}));
  EXPECT_FALSE(align_rotation(some, flat, kCamera));
  EXPECT_FALSE(align_rotation(flat, some, kCamera));
  EXPECT_FALSE(align_rotation(SmallImage(), SmallImage(), kCamera));
  EXPECT_FALSE(align_rotation(some, shrink_image(cv::Mat1b(240, 640, std::uint8_t{3})), kCamera));
}

}  // namespace
}  // namespace orbslam
