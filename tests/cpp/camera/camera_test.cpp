// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/errors.hpp"
#include "support/npy.hpp"

namespace orbslam {
namespace {

using testing::read_npy;
using testing::test_data;

testing::Array<float> golden(const std::string& name) {
  return read_npy<float>(test_data("golden/undist/" + name + ".npy"));
}

CameraOptions golden_options() {
  const auto k = golden("K").values;
  const auto d = golden("dist").values;
  CameraOptions options;
  options.pinhole = {k[0], k[1], k[2], k[3]};
  options.distortion = {d[0], d[1], d[2], d[3], d[4]};
  options.image_size = {640, 480};
  return options;
}

CameraOptions rectified_options() {
  CameraOptions options;
  options.pinhole = {500, 510, 320, 240};
  options.image_size = {640, 480};
  options.bf = 40;
  options.depth_ratio = 35;
  return options;
}

// The forward model, written from its formula.
std::pair<double, double> distort(const Pinhole& k, const Distortion& d, double u, double v) {
  const double x = (u - k.cx) / k.fx, y = (v - k.cy) / k.fy, r2 = x * x + y * y;
  const double radial = (1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]))) /
                        (1 + r2 * (d[5] + r2 * (d[6] + r2 * d[7])));
  return {k.fx * (x * radial + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x)) + k.cx,
          k.fy * (y * radial + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y) + k.cy};
}

TEST(Camera, UndistortionEqualsTheGoldenGridAndKeypointsBitByBit) {
  const Camera camera(golden_options());
  ASSERT_FALSE(camera.lens().is_identity());
  for (const auto& [raw, expected] : {std::pair("grid", "out_grid_un"), {"out_kp", "out_kpun"}}) {
    auto xy = golden(raw).values;
    camera.lens().undistort(camera.pinhole(), xy);
    EXPECT_EQ(xy, golden(expected).values) << raw;
  }
}

TEST(Camera, BoundsEqualTheGoldenOnes) {
  const ImageBounds bounds = Camera(golden_options()).bounds();
  const auto expected = golden("out_bounds").values;
  EXPECT_EQ(bounds.min_x, expected[0]);
  EXPECT_EQ(bounds.max_x, expected[1]);
  EXPECT_EQ(bounds.min_y, expected[2]);
  EXPECT_EQ(bounds.max_y, expected[3]);
}

TEST(Camera, DistortingAgainReturnsTheRawPixels) {
  // Where keypoints can lie; five iterations leave more than this in the very corners.
  const CameraOptions options = golden_options();
  const Camera camera(options);
  for (int v = 16; v <= 464; v += 16) {
    for (int u = 16; u <= 624; u += 16) {
      std::vector<float> xy = {static_cast<float>(u), static_cast<float>(v)};
      camera.lens().undistort(camera.pinhole(), xy);
      const auto [x, y] = distort(options.pinhole, options.distortion, xy[0], xy[1]);
      EXPECT_NEAR(x, u, 0.05);
      EXPECT_NEAR(y, v, 0.05);
    }
  }
}

// The lens of an Azure Kinect's colour camera, by its factory calibration.
CameraOptions rational_options() {
  CameraOptions options;
  options.pinhole = {611.5, 611.3, 639.2, 367.1};
  options.distortion = {0.46, -2.63, 0.0006, -0.0003, 1.52, 0.34, -2.45, 1.45};
  options.image_size = {1280, 720};
  return options;
}

TEST(Camera, TheRationalLensIsUndistortedOverTheWholeImage) {
  const CameraOptions options = rational_options();
  const Camera camera(options);
  for (int v = 0; v <= 720; v += 16) {
    for (int u = 0; u <= 1280; u += 16) {
      std::vector<float> xy = {static_cast<float>(u), static_cast<float>(v)};
      camera.lens().undistort(camera.pinhole(), xy);
      const auto [x, y] = distort(options.pinhole, options.distortion, xy[0], xy[1]);
      EXPECT_NEAR(x, u, 2e-4) << u << ' ' << v;
      EXPECT_NEAR(y, v, 2e-4) << u << ' ' << v;
    }
  }
}

TEST(Camera, ARationalLensWithoutItsDenominatorIsTheRadialOne) {
  CameraOptions options = golden_options();
  auto radial = golden("grid").values, rational = radial;
  Camera(options).lens().undistort(options.pinhole, radial);
  options.distortion[7] = 1e-15;  // not 0: Newton's method
  Camera(options).lens().undistort(options.pinhole, rational);
  for (std::size_t i = 0; i < radial.size(); ++i) EXPECT_NEAR(radial[i], rational[i], 0.4);
}

TEST(Camera, RectifiedBoundsAreTheImageRectangle) {
  const Camera camera(rectified_options());
  EXPECT_TRUE(camera.lens().is_identity());
  EXPECT_EQ(camera.bounds().min_x, 0.0F);
  EXPECT_EQ(camera.bounds().max_x, 640.0F);
  EXPECT_EQ(camera.bounds().min_y, 0.0F);
  EXPECT_EQ(camera.bounds().max_y, 480.0F);
}

TEST(Camera, BoundsOfFramesAreClosedAndThoseOfKeyframesHalfOpen) {
  const ImageBounds bounds{-1, 640, -2, 480};
  EXPECT_TRUE(bounds.contains(640, 480));
  EXPECT_TRUE(bounds.contains(-1, -2));
  EXPECT_FALSE(bounds.contains(640.01, 0));
  EXPECT_FALSE(bounds.contains(0, -2.01));
  EXPECT_TRUE(bounds.contains_half_open(-1, -2));
  EXPECT_FALSE(bounds.contains_half_open(640, 0));
  EXPECT_FALSE(bounds.contains_half_open(0, 480));
}

// OD-2: not the first coefficient alone.
TEST(Camera, AnyCoefficientMakesALens) {
  for (std::size_t i = 0; i < 8; ++i) {
    CameraOptions options = rectified_options();
    options.distortion[i] = 0.01;
    EXPECT_FALSE(Camera(options).lens().is_identity()) << "coefficient " << i;
  }
}

TEST(Camera, NoPointsToUndistortIsFine) {
  std::vector<float> none;
  const Camera camera(golden_options());
  camera.lens().undistort(camera.pinhole(), none);
  EXPECT_TRUE(none.empty());
}

// OD-4: a single camera has a limit of close points, too: infinity.
TEST(Camera, BaselineAndCloseDepthFollowFromBf) {
  const Camera camera(rectified_options());
  EXPECT_DOUBLE_EQ(camera.baseline(), 0.08);
  EXPECT_DOUBLE_EQ(camera.close_depth(), 2.8);
  EXPECT_DOUBLE_EQ(camera.right_column(100, 2), 80);

  CameraOptions mono = rectified_options();
  mono.bf = 0;
  mono.depth_ratio = 0;
  EXPECT_FALSE(Camera(mono).has_baseline());
  EXPECT_TRUE(std::isinf(Camera(mono).close_depth()));
}

TEST(Camera, ProjectionAndUnprojectionAreInverse) {
  const Pinhole pinhole = rectified_options().pinhole;
  const Eigen::Vector3d point(0.3, -0.4, 2.5);
  const Eigen::Vector2d pixel = pinhole.project(point);
  EXPECT_DOUBLE_EQ(pixel.x(), 380);
  EXPECT_TRUE(pinhole.unproject(pixel.x(), pixel.y(), 2.5).isApprox(point, 1e-14));
}

struct WrongOption {
  const char* word;  // must occur in the message
  void (*spoil)(CameraOptions&);
};

class CameraChecks : public ::testing::TestWithParam<WrongOption> {};

TEST_P(CameraChecks, NameTheWrongOption) {
  CameraOptions options = rectified_options();
  GetParam().spoil(options);
  try {
    const Camera camera(options);
    FAIL() << "accepted";
  } catch (const SettingsError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr(GetParam().word));
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, CameraChecks,
    ::testing::Values(WrongOption{"Camera.fx", [](CameraOptions& o) { o.pinhole.fx = 0; }},
                      WrongOption{"Camera.fy", [](CameraOptions& o) { o.pinhole.fy = -500; }},
                      WrongOption{"Camera.fx", [](CameraOptions& o) { o.pinhole.fx = NAN; }},
                      WrongOption{"Camera.cx", [](CameraOptions& o) { o.pinhole.cx = INFINITY; }},
                      WrongOption{"image size", [](CameraOptions& o) { o.image_size.width = 0; }},
                      WrongOption{"image size", [](CameraOptions& o) { o.image_size.height = -1; }},
                      WrongOption{"distortion", [](CameraOptions& o) { o.distortion[4] = NAN; }},
                      WrongOption{"Camera.bf", [](CameraOptions& o) { o.bf = -1; }},
                      WrongOption{"ThDepth", [](CameraOptions& o) { o.depth_ratio = 0; }},
                      WrongOption{"fold", [](CameraOptions& o) {
                                    o.distortion = {-0.1, -1.1, 0.7, 2.5, 3.0};
                                  }}));

}  // namespace
}  // namespace orbslam
