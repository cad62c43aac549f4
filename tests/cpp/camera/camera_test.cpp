// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/errors.hpp"
#include "support/cameras.hpp"
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

/// Interleaved x, y of raw pixels as the camera undistorts them.
std::vector<float> undistorted(const Camera& camera, std::vector<float> xy) {
  for (std::size_t i = 0; i + 1 < xy.size(); i += 2) {
    const Eigen::Vector2f uv = camera.from_image({xy[i], xy[i + 1]});
    xy[i] = uv.x();
    xy[i + 1] = uv.y();
  }
  return xy;
}

// The forward model, written from its formula.
std::pair<double, double> distort(const Pinhole& k, const Distortion& d, double u, double v) {
  const double x = (u - k.cx) / k.fx, y = (v - k.cy) / k.fy, r2 = x * x + y * y;
  const double radial =
      (1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]))) / (1 + r2 * (d[5] + r2 * (d[6] + r2 * d[7])));
  return {k.fx * (x * radial + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x)) + k.cx,
          k.fy * (y * radial + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y) + k.cy};
}

// The golden numbers come from five steps of a fixed point, which end up to 0.3 pixels from the
// solution.
constexpr float kFivePoorSteps = 0.4F;

TEST(Camera, UndistortionIsNearTheGoldenGridAndKeypoints) {
  const Camera camera(golden_options());
  ASSERT_TRUE(camera.distorts());
  for (const auto& [raw, expected] : {std::pair("grid", "out_grid_un"), {"out_kp", "out_kpun"}}) {
    const auto ours = undistorted(camera, golden(raw).values);
    const auto theirs = golden(expected).values;
    ASSERT_EQ(ours.size(), theirs.size());
    for (std::size_t i = 0; i < ours.size(); ++i) {
      EXPECT_NEAR(ours[i], theirs[i], kFivePoorSteps) << raw << ' ' << i;
    }
  }
}

TEST(Camera, BoundsAreNearTheGoldenOnes) {
  const ImageBounds bounds = Camera(golden_options()).bounds();
  const auto expected = golden("out_bounds").values;
  EXPECT_NEAR(bounds.min_x, expected[0], kFivePoorSteps);
  EXPECT_NEAR(bounds.max_x, expected[1], kFivePoorSteps);
  EXPECT_NEAR(bounds.min_y, expected[2], kFivePoorSteps);
  EXPECT_NEAR(bounds.max_y, expected[3], kFivePoorSteps);
}

TEST(Camera, DistortingAgainReturnsTheRawPixels) {
  const CameraOptions options = golden_options();
  const Camera camera(options);
  for (int v = 16; v <= 464; v += 16) {
    for (int u = 16; u <= 624; u += 16) {
      const Eigen::Vector2f uv = camera.from_image(Eigen::Vector2i(u, v).cast<float>());
      const auto [x, y] = distort(options.pinhole, options.distortion, uv.x(), uv.y());
      EXPECT_NEAR(x, u, 1e-4);
      EXPECT_NEAR(y, v, 1e-4);
    }
  }
}

// Lenses of the rational model, by the factory calibrations of cameras.
CameraOptions rational_options(int which) {
  CameraOptions options;
  options.image_size = {1280, 720};
  if (which == 0) {  // colour camera of an Azure Kinect
    options.pinhole = {611.5, 611.3, 639.2, 367.1};
    options.distortion = {0.46, -2.63, 0.0006, -0.0003, 1.52, 0.34, -2.45, 1.45};
  } else if (which == 1) {  // its wide depth camera
    options.pinhole = {252.3, 252.4, 256.1, 258.3};
    options.distortion = {5.2, 3.3, -6e-5, 8e-5, 0.18, 5.5, 5.1, 0.94};
    options.image_size = {512, 512};
  } else {  // grey camera of an OAK-D
    options.pinhole = {800.2, 800.5, 652.3, 355.7};
    options.distortion = {-10.4, 67.5, 0.0012, -0.0008, -19.2, -10.5, 67.9, -20.3};
  }
  return options;
}

TEST(Camera, RationalLensesAreUndistortedOverTheWholeImage) {
  for (int which = 0; which < 3; ++which) {
    const CameraOptions options = rational_options(which);
    const Camera camera(options);
    for (int v = 0; v <= options.image_size.height; v += 16) {
      for (int u = 0; u <= options.image_size.width; u += 16) {
        const Eigen::Vector2f uv = camera.from_image(Eigen::Vector2i(u, v).cast<float>());
        const auto [x, y] = distort(options.pinhole, options.distortion, uv.x(), uv.y());
        EXPECT_NEAR(x, u, 1e-4) << which << ": " << u << ' ' << v;
        EXPECT_NEAR(y, v, 1e-4) << which << ": " << u << ' ' << v;
      }
    }
  }
}

TEST(Camera, ThroughTheLensIsByTheFormula) {
  for (int which = 0; which < 3; ++which) {
    const CameraOptions options = rational_options(which);
    const auto [u, v] = distort(options.pinhole, options.distortion, 200.25, 310.5);
    EXPECT_TRUE(Camera(options).to_image({200.25, 310.5}).isApprox(Eigen::Vector2d(u, v), 1e-12));
  }
  const Eigen::Vector2d pixel(1.5, 2.5);
  EXPECT_EQ(Camera(rectified_options()).to_image(pixel), pixel);
  EXPECT_EQ(Camera(rectified_options()).from_image({1.5F, 2.5F}), Eigen::Vector2f(1.5F, 2.5F));
}

// r / (1 + r^2) is at most 1/2: farther out the lens shows nothing.
TEST(Camera, WhereARationalLensShowsNothingPixelsStay) {
  CameraOptions options = rectified_options();
  options.pinhole = {700, 700, 320, 240};
  options.distortion[5] = 1;
  const Camera camera(options);
  const Eigen::Vector2f corner(639, 479);
  EXPECT_TRUE(camera.from_image(corner).isApprox(corner, 1e-6F));
  EXPECT_FALSE(camera.shows(corner.cast<double>()));
  EXPECT_NEAR(camera.from_image({320 + 350.0F - 1, 240}).x(), 320 + 700 * 0.92711, 0.2);
}

TEST(Camera, RectifiedBoundsAreTheImageRectangle) {
  const Camera camera(rectified_options());
  EXPECT_FALSE(camera.distorts());
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
    EXPECT_TRUE(Camera(options).distorts()) << "coefficient " << i;
  }
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
  const Camera camera(rectified_options());
  const Eigen::Vector3d point(0.3, -0.4, 2.5);
  Eigen::Vector2d pixel;
  ASSERT_TRUE(camera.project(point, pixel));
  EXPECT_DOUBLE_EQ(pixel.x(), 380);
  EXPECT_TRUE(camera.unproject(pixel.x(), pixel.y(), 2.5).isApprox(point, 1e-14));
  EXPECT_TRUE(camera.ray(pixel.x(), pixel.y()).isApprox(point / 2.5, 1e-14));
}

TEST(Camera, PointsThatAreNotInFrontHaveNoPixel) {
  const Camera camera(rectified_options());
  for (const double z : {0.0, -1.0, static_cast<double>(NAN)}) {
    const Eigen::Vector3d point(0.3, -0.4, z);
    Eigen::Vector2d pixel(7, 8);
    Seen seen;
    EXPECT_FALSE(camera.project(point, pixel));
    EXPECT_FALSE(camera.project(point, seen));
    EXPECT_EQ(pixel, Eigen::Vector2d(7, 8));
  }
}

TEST(Camera, TheJacobianIsTheDerivativeOfTheProjection) {
  const Camera camera(rectified_options());
  const Eigen::Vector3d point(0.3, -0.4, 2.5);
  constexpr double kStep = 1e-6;
  Seen seen;
  Eigen::Vector2d pixel, above, below;
  ASSERT_TRUE(camera.project(point, seen) && camera.project(point, pixel));
  EXPECT_EQ(seen.uv, pixel);
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d shift = kStep * Eigen::Vector3d::Unit(axis);
    ASSERT_TRUE(camera.project(point + shift, above) && camera.project(point - shift, below));
    EXPECT_TRUE(seen.J.col(axis).isApprox((above - below) / (2 * kStep), 1e-7)) << axis;
  }
}

TEST(Camera, ASmallTurnMovesTheMiddleByPixelsPerRadian) {
  const Camera camera(rectified_options());
  Eigen::Vector2d pixel;
  ASSERT_TRUE(camera.project({std::sin(1e-3), 0, std::cos(1e-3)}, pixel));
  EXPECT_NEAR(pixel.x() - 320, 1e-3 * camera.pixels_per_radian(), 1e-6);
}

// The same for each kind of image plane.
class EachLens : public ::testing::TestWithParam<testing::TestLens> {
 protected:
  std::shared_ptr<const Camera> camera_ = testing::make_camera(GetParam(), 40);
};

TEST_P(EachLens, RaysAreProjectedToTheirPixels) {
  for (int v = 20; v < 480; v += 40) {
    for (int u = 20; u < 640; u += 40) {
      const Eigen::Vector3d ray = camera_->ray(u, v);
      Eigen::Vector2d pixel;
      ASSERT_TRUE(camera_->project(3.7 * ray, pixel));
      EXPECT_NEAR((pixel - Eigen::Vector2d(u, v)).norm(), 0, 1e-8) << u << ' ' << v;
      if (ray.z() <= 0) continue;
      const Eigen::Vector3d point = camera_->unproject(u, v, 2.5);
      EXPECT_NEAR(camera_->is_flat() ? point.z() : point.norm(), 2.5, 1e-12);
      const double depth = camera_->depth_of_axial(u, v, 2.5);
      if (ray.normalized().z() < 0.06) continue;
      EXPECT_NEAR(camera_->unproject(u, v, depth).z(), 2.5, 1e-9);
      EXPECT_NEAR(point.cross(ray).norm(), 0, 1e-9);
    }
  }
}

TEST_P(EachLens, ASightGivesTheErrorInRawPixels) {
  for (int v = 20; v < 480; v += 40) {
    for (int u = 20; u < 640; u += 40) {
      const Sight sight = camera_->sight(u, v);
      const Eigen::Vector2d raw = camera_->to_image({u, v});
      const Eigen::Vector3d ray = camera_->ray(u, v).normalized();
      for (const double turn : {1e-5, 1e-3}) {
        const Eigen::Vector3d p = 5 * (ray + turn * Eigen::Vector3d(0.6, -0.7, 0.2));
        Eigen::Vector2d pixel, error;
        ASSERT_TRUE(camera_->project(p, pixel));
        ASSERT_TRUE(camera_->error(p, u, v, error));
        const Eigen::Vector2d exact = camera_->to_image(pixel) - raw;
        const Eigen::Vector3d q = apply(sight, p);
        EXPECT_GT(q.z(), 0);
        // The rest is of second order.
        EXPECT_NEAR((q.head<2>() / q.z() - exact).norm(), 0, 3e3 * turn * turn + 1e-9);
        EXPECT_NEAR((error - exact).norm(), 0, 3e3 * turn * turn + 1e-9);
      }
    }
  }
}

TEST_P(EachLens, TheRightErrorIsThatOfTheDisparityAsWell) {
  const Eigen::Vector3d p(0.4, -0.2, 3);
  Eigen::Vector2d pixel, error;
  ASSERT_TRUE(camera_->project(p, pixel));
  const double right_u = pixel.x() - camera_->disparity(p);
  ASSERT_TRUE(camera_->error(p, pixel.x(), pixel.y(), error));
  EXPECT_NEAR(camera_->right_error(p, error, pixel.x(), pixel.y(), right_u), 0, 1e-9);
  EXPECT_NEAR(camera_->right_error(p, error, pixel.x(), pixel.y(), right_u + 2), -2, 1e-9);
}

INSTANTIATE_TEST_SUITE_P(Lenses, EachLens, ::testing::ValuesIn(testing::kTestLenses));

TEST(Camera, AFisheyeLensHasTheImageForItsPlane) {
  const auto camera = testing::make_camera(testing::TestLens::fisheye);
  EXPECT_FALSE(camera->is_flat());
  EXPECT_FALSE(camera->distorts());
  EXPECT_EQ(camera->from_image({1.5F, 2.5F}), Eigen::Vector2f(1.5F, 2.5F));
  EXPECT_EQ(camera->bounds().max_x, 640.0F);
  EXPECT_NEAR(camera->pixels_per_radian(), 230, 1e-9);
  Eigen::Vector2d pixel;
  EXPECT_TRUE(camera->project({5, 0, 0.1}, pixel)) << "nearly 90 degrees from the axis";
}

TEST(Camera, RefusesAModelOfAnotherImageSize) {
  CameraOptions options = rectified_options();
  options.model = std::make_shared<CameraModel>(
      "double_sphere", std::vector<double>{200, 200, 300, 200, -0.2, 0.6}, ImageSize{600, 400});
  EXPECT_THROW(Camera{options}, SettingsError);
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
