// SPDX-License-Identifier: BSD-3-Clause
#include "frame/wide_pair.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>

#include "base/errors.hpp"
#include "frame/stereo_pair.hpp"

namespace orbslam {
namespace {

using testing::resized_pyramid;

constexpr ImageSize kWideSize{400, 400};
constexpr double kDistance = 2.5;  // of the textured sphere around the left camera

const ScalePyramid& wide_scales() {
  static const ScalePyramid tables(1.2F, 8);
  return tables;
}

/// 195 degrees: the border is 1.7 rad from the axis.
CameraModel lens(double cx = 199.5) {
  return {"kannala_brandt", {117, 117, cx, 199.5, -0.01, 0.002, 0, 0}, kWideSize};
}

/// The right camera stands 0.15 m to the right, a little before the left one, and is turned.
Pose extrinsics() {
  const Eigen::Matrix3d R(
      Eigen::AngleAxisd(0.05, Eigen::Vector3d(0.2, 1, 0.3).normalized()).toRotationMatrix());
  return Pose(R, -R * Eigen::Vector3d(0.15, 0.01, 0.02));
}

std::shared_ptr<const Camera> left_camera(const Pose& T_rl = extrinsics()) {
  CameraOptions options;
  options.image_size = kWideSize;
  options.depth_ratio = 40;
  options.model = std::make_shared<CameraModel>(lens());
  options.right_centre = T_rl.center();
  return std::make_shared<Camera>(options);
}

/// Smooth grey values in space that look different everywhere.
double texture(const Eigen::Vector3d& p) {
  double sum = 0;
  const double waves[][4] = {{9, 4, -6, 0.3}, {-5, 11, 3, 1.1},   {7, -8, 10, 2.2},
                             {13, 6, 5, 0.7}, {-10, -3, 12, 1.9}, {4, 14, -9, 2.8}};
  for (const auto& w : waves)
    sum += std::sin(1.7 * (w[0] * p.x() + w[1] * p.y() + w[2] * p.z()) + w[3]);
  return 127 + 20 * sum;
}

/// What a camera sees of the inner side of the sphere around the left one.
cv::Mat image_of(const CameraModel& model, const Pose& T_cl) {
  cv::Mat image(kWideSize.height, kWideSize.width, CV_8UC1, cv::Scalar(0));
  const Eigen::Matrix3d R_lc = T_cl.rotation_matrix().transpose();
  const Eigen::Vector3d centre = T_cl.center();
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      Eigen::Vector3d ray;
      if (!model.unproject({u, v}, ray)) continue;
      const Eigen::Vector3d d = R_lc * ray;
      const double b = d.dot(centre);
      const double t = -b + std::sqrt(b * b - centre.squaredNorm() + kDistance * kDistance);
      image.at<std::uint8_t>(v, u) = cv::saturate_cast<std::uint8_t>(texture(centre + t * d));
    }
  }
  return image;
}

Keypoint keypoint_at(const Eigen::Vector2d& uv, std::int32_t level) {
  Keypoint keypoint;
  keypoint.x = static_cast<float>(uv.x());
  keypoint.y = static_cast<float>(uv.y());
  keypoint.level = level;
  return keypoint;
}

struct SpherePair {
  Extraction left, right;
};

/// Keypoints on a grid of the left image; the right ones are up to a pixel beside their true place.
SpherePair sphere_pair(const Pose& T_rl = extrinsics(), std::int32_t level = 0) {
  const CameraModel left = lens(), right = lens(203);
  SpherePair pair;
  pair.left.pyramid = resized_pyramid(image_of(left, Pose()), wide_scales());
  pair.right.pyramid = resized_pyramid(image_of(right, T_rl), wide_scales());
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> off(-0.7, 0.7);
  for (int v = 20; v < 390; v += 12) {
    for (int u = 20; u < 390; u += 12) {
      Eigen::Vector3d ray;
      Seen seen;
      if (!left.unproject({u, v}, ray) || !right.project(T_rl * (kDistance * ray), seen)) continue;
      Descriptor descriptor;
      for (std::uint64_t& word : descriptor.words) word = random();
      pair.left.features.keypoints.push_back(keypoint_at({u, v}, level));
      pair.left.features.descriptors.push_back(descriptor);
      pair.right.features.keypoints.push_back(
          keypoint_at(seen.uv + Eigen::Vector2d(off(random), off(random)), level));
      pair.right.features.descriptors.push_back(descriptor);
    }
  }
  return pair;
}

TEST(WidePair, FindsTheDistanceAlongEveryRayThatBothCamerasSee) {
  const WidePair pair(left_camera(), lens(203), extrinsics());
  const SpherePair images = sphere_pair();
  const StereoMatches found = pair.match(images.left, images.right, wide_scales());
  int n_found = 0, n_beyond = 0, n_possible = 0;
  double worst = 0;
  for (std::size_t i = 0; i < found.depth.size(); ++i) {
    const Keypoint& keypoint = images.left.features.keypoints[i];
    const Eigen::Vector3d ray = pair.left().ray(keypoint.x, keypoint.y);
    const Eigen::Vector3d along = pair.left().options().right_centre.normalized();
    const bool possible = std::abs(ray.dot(along)) < 0.9;
    n_possible += possible;
    if (!(found.depth[i] > 0)) continue;
    ++n_found;
    n_beyond += ray.z() < 0;
    // Inverse depths are measured, with a noise that grows towards the baseline.
    const double disparity = pair.left().disparity(keypoint.x, keypoint.y, found.depth[i]);
    const double exact = pair.left().disparity(keypoint.x, keypoint.y, kDistance);
    EXPECT_NEAR(keypoint.x - found.right_u[i], disparity, 1e-3);
    worst = std::max(worst, std::abs(disparity - exact));
  }
  EXPECT_GT(n_found, 0.8 * n_possible);
  EXPECT_GT(n_beyond, 10);
  EXPECT_LT(worst, 0.25);  // pixels
}

// A straight line is bent to the other side in the image of a camera that looks aside.
TEST(WidePair, IsNotBiasedWhenTheCamerasLookInDifferentDirections) {
  const Eigen::AngleAxisd turn(-1.5707963, Eigen::Vector3d::UnitY());
  const Eigen::Matrix3d R = turn.toRotationMatrix();
  const Pose T_rl(R, -R * Eigen::Vector3d(0.15, 0, -0.15));
  const WidePair pair(left_camera(T_rl), lens(203), T_rl);
  const SpherePair images = sphere_pair(T_rl, 4);
  const StereoMatches found = pair.match(images.left, images.right, wide_scales());
  double sum = 0;
  int n = 0;
  for (std::size_t i = 0; i < found.depth.size(); ++i) {
    if (!(found.depth[i] > 0)) continue;
    const Keypoint& keypoint = images.left.features.keypoints[i];
    sum += pair.left().disparity(keypoint.x, keypoint.y, found.depth[i]) -
           pair.left().disparity(keypoint.x, keypoint.y, kDistance);
    ++n;
  }
  EXPECT_GT(n, 100);
  EXPECT_NEAR(sum / n, 0, 0.08);  // without the correction 0.18 pixels
}

TEST(WidePair, FindsNothingWhenTheImagesAreSwapped) {
  const WidePair pair(left_camera(), lens(203), extrinsics());
  const SpherePair images = sphere_pair();
  const StereoMatches found = pair.match(images.right, images.left, wide_scales());
  const auto n_found =
      std::count_if(found.depth.begin(), found.depth.end(), [](float depth) { return depth > 0; });
  EXPECT_LT(static_cast<double>(n_found), 0.1 * static_cast<double>(found.depth.size()));
}

TEST(WidePair, GivesNoDepthInTheDirectionOfTheOtherCamera) {
  const WidePair pair(left_camera(), lens(203), extrinsics());
  const SpherePair images = sphere_pair();
  const StereoMatches found = pair.match(images.left, images.right, wide_scales());
  for (std::size_t i = 0; i < found.depth.size(); ++i) {
    const Keypoint& keypoint = images.left.features.keypoints[i];
    const Eigen::Vector3d ray = pair.left().ray(keypoint.x, keypoint.y);
    if (std::abs(ray.dot(pair.left().options().right_centre.normalized())) > 0.99) {
      EXPECT_EQ(found.depth[i], -1);
    }
  }
}

TEST(WidePair, MeasuresTheDistanceOfTwoRays) {
  const WidePair pair(left_camera(), lens(), extrinsics());
  for (const Eigen::Vector3d& p : {Eigen::Vector3d(0.4, -0.3, 2), Eigen::Vector3d(-0.3, 1.5, -0.4),
                                   Eigen::Vector3d(0.02, 5, 0.1)}) {
    EXPECT_NEAR(pair.distance(p.normalized(), (extrinsics() * p).normalized()), p.norm(), 1e-9);
  }
}

TEST(WidePair, RefusesACameraWithoutItsCentre) {
  CameraOptions options;
  options.image_size = kWideSize;
  options.model = std::make_shared<CameraModel>(lens());
  EXPECT_THROW(WidePair(std::make_shared<Camera>(options), lens(), extrinsics()), SettingsError);
  const Pose elsewhere(extrinsics().rotation_matrix(), Eigen::Vector3d(0.3, 0, 0));
  EXPECT_THROW(WidePair(left_camera(), lens(), elsewhere), SettingsError);
}

// What the solvers take: the third row of a sight gives the disparity, its first row the direction.
TEST(WidePair, SightsTellDisparityAndEpipolarDirection) {
  const auto camera = left_camera();
  const Eigen::Vector3d centre = camera->options().right_centre;
  for (const Eigen::Vector3d& p : {Eigen::Vector3d(0.4, -0.3, 2), Eigen::Vector3d(-0.3, 1.5, -0.4),
                                   Eigen::Vector3d(1, 3, 0.5)}) {
    Eigen::Vector2d uv;
    ASSERT_TRUE(camera->project(p, uv));
    const Eigen::Matrix3d B = camera->sight(uv.x(), uv.y()).leftCols<3>();
    EXPECT_NEAR((B * p).head<2>().norm(), 0, 1e-8);
    EXPECT_NEAR(camera->bf() / B.row(2).dot(p), camera->disparity(p), 1e-9);
    EXPECT_NEAR(camera->disparity(uv.x(), uv.y(), p.norm()), camera->disparity(p), 1e-9);
    // A camera at the right centre sees a far point shifted by the disparity, in this direction.
    const Eigen::Vector3d far = 1000 * p;
    Eigen::Vector2d from_there;
    ASSERT_TRUE(camera->project(far - centre, from_there));
    const Eigen::Vector2d shift = from_there - uv;
    EXPECT_NEAR(shift.norm(), camera->disparity(far), 1e-3 * camera->disparity(far));
    EXPECT_NEAR(camera->along_epipolar_curve(-shift, uv.x(), uv.y()), shift.norm(),
                1e-3 * shift.norm());
    // Errors keep their length.
    const Eigen::Vector3d q = B * (p + Eigen::Vector3d(1e-4, -2e-4, 1e-4));
    Eigen::Vector2d error;
    ASSERT_TRUE(camera->error(p + Eigen::Vector3d(1e-4, -2e-4, 1e-4), uv.x(), uv.y(), error));
    EXPECT_NEAR((q.head<2>() / q.z()).norm(), error.norm(), 1e-3 * error.norm());
    const double right_u = uv.x() - camera->disparity(p);
    ASSERT_TRUE(camera->error(p, uv.x(), uv.y(), error));
    EXPECT_NEAR(camera->right_error(p, error, uv.x(), uv.y(), right_u), 0, 1e-8);
  }
}

}  // namespace
}  // namespace orbslam
