// SPDX-License-Identifier: BSD-3-Clause
#include "camera/lens_models.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "camera/camera_model.hpp"
#include "support/directions.hpp"

namespace orbslam {
namespace {

using testing::angle_between;
using testing::direction;
using testing::kDegree;

// ---- values of the published formulas, by hand ----
/// The point where a camera of focal lengths 200 and 100, principal point (320, 240), shows a
/// point: relative to the principal point, at focal length 1.
Eigen::Vector2d shown_at(const std::string& model, const std::vector<double>& lens,
                         const Eigen::Vector3d& point) {
  std::vector<double> parameters{200, 100, 320, 240};
  parameters.insert(parameters.end(), lens.begin(), lens.end());
  Seen seen;
  EXPECT_TRUE(CameraModel(model, parameters, {640, 480}).project(point, seen));
  return {(seen.uv.x() - 320) / 200, (seen.uv.y() - 240) / 100};
}

void expect_at(const Eigen::Vector2d& at, double x, double y) {
  EXPECT_NEAR(at.x(), x, 1e-12);
  EXPECT_NEAR(at.y(), y, 1e-12);
}

TEST(CameraModelFormula, Pinhole) { expect_at(shown_at("pinhole", {}, {3, -1, 4}), 0.75, -0.25); }

// x = 0.5, y = 1, r2 = 1.25.
TEST(CameraModelFormula, RadialTangential) {
  const double radial = 1 + 0.08 * 1.25 + 0.04 * 1.25 * 1.25;
  const double x = 0.5 * radial + 2 * 0.01 * 0.5 + 0.02 * (1.25 + 2 * 0.25);
  const double y = radial + 0.01 * (1.25 + 2) + 2 * 0.02 * 0.5;
  expect_at(shown_at("radtan4", {0.08, 0.04, 0.01, 0.02}, {1, 2, 2}), x, y);
  expect_at(shown_at("radtan5", {0.08, 0.04, 0.01, 0.02, 0}, {1, 2, 2}), x, y);
  const double sixth = 0.016 * 1.25 * 1.25 * 1.25;
  expect_at(shown_at("radtan5", {0.08, 0.04, 0.01, 0.02, 0.016}, {1, 2, 2}), x + 0.5 * sixth,
            y + sixth);
}

TEST(CameraModelFormula, RationalAndThinPrism) {
  const double radial = (1 + 0.8 * 1.25) / (1 + 0.4 * 1.25);
  std::vector<double> lens{0.8, 0, 0, 0, 0, 0.4, 0, 0};
  expect_at(shown_at("rational", lens, {1, 2, 2}), 0.5 * radial, radial);
  lens.insert(lens.end(), {0.01, 0.02, 0.03, 0.04});
  expect_at(shown_at("thin_prism", lens, {1, 2, 2}), 0.5 * radial + 0.0125 + 0.02 * 1.5625,
            radial + 0.0375 + 0.04 * 1.5625);
}

// 45 degrees and 120 degrees from the axis.
TEST(CameraModelFormula, KannalaBrandt) {
  const double theta = 45 * kDegree, t = theta * theta;
  const double radius = theta * (1 + t * (0.1 + t * (0.01 + t * (0.001 + t * 0.0001))));
  expect_at(shown_at("kannala_brandt", {0.1, 0.01, 0.001, 0.0001}, {3, 4, 5}), 0.6 * radius,
            0.8 * radius);
  expect_at(shown_at("kannala_brandt", {0, 0, 0, 0}, direction(120 * kDegree, 0)), 120 * kDegree,
            0);
}

// d1 = 5, z2 = 4 - 0.2 * 5 = 3, d2 = sqrt(9 + 9).
TEST(CameraModelFormula, DoubleSphere) {
  expect_at(shown_at("double_sphere", {-0.2, 0.6}, {3, 0, 4}),
            3 / (0.6 * std::sqrt(18.0) + 0.4 * 3), 0);
  expect_at(shown_at("double_sphere", {0, 0}, {3, -1, 4}), 0.75, -0.25);
}

// d = sqrt(2 * (9 + 16) + 144) = sqrt(194).
TEST(CameraModelFormula, ExtendedUnified) {
  const double denominator = 0.7 * std::sqrt(194.0) + 0.3 * 12;
  expect_at(shown_at("eucm", {0.7, 2}, {3, 4, 12}), 3 / denominator, 4 / denominator);
}

// With xi = 1 it is stereographic: m = tan(theta / 2), here 0.5 for (4, 0, 3).
TEST(CameraModelFormula, Mei) {
  expect_at(shown_at("mei", {1, 0, 0, 0, 0}, {4, 0, 3}), 0.5, 0);
  expect_at(shown_at("mei", {1, 0.2, 0.4, 0.01, 0.02}, {4, 0, 3}),
            0.5 * (1 + 0.2 * 0.25 + 0.4 * 0.0625) + 0.02 * 0.75, 0.01 * 0.25);
}

// With omega = 90 degrees the radius is atan(2 r) / (pi / 2).
TEST(CameraModelFormula, FieldOfView) {
  const double omega = 90 * kDegree;
  expect_at(shown_at("fov", {omega}, {1, 0, 2}), 0.5, 0);
  expect_at(shown_at("fov", {omega}, {0, 1, 0}), 0, 1);
  expect_at(shown_at("fov", {omega}, {0, 1, -2}), 0, 1.5);
}

// ---- ends of the domains ----
/// Angle from the axis, in degrees, at which the model ends along x.
double end_of(const CameraModel& camera) {
  double inside = 0, outside = 180;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (inside + outside);
    Seen seen;
    (camera.project(direction(middle * kDegree, 0), seen) ? inside : outside) = middle;
  }
  return inside;
}

double end_of(const std::string& model, const std::vector<double>& lens) {
  std::vector<double> parameters{200, 200, 320, 240};
  parameters.insert(parameters.end(), lens.begin(), lens.end());
  return end_of({model, parameters, {640, 480}});
}

TEST(CameraModelDomain, EndsWhereTheModelFoldsOver) {
  EXPECT_NEAR(end_of("pinhole", {}), 90, 1e-9);
  // 1 + 3 k1 r^2 = 0 at r = 1.
  EXPECT_NEAR(end_of("radtan4", {-1.0 / 3, 0, 0, 0}), 45, 1e-9);
  // Pole of the rational model: 1 + k4 r^2 = 0 at r = 1.
  EXPECT_NEAR(end_of("rational", {0, 0, 0, 0, 0, -1, 0, 0}), 45, 1e-9);
  // 1 + 3 k1 theta^2 = 0 at theta = 100 degrees.
  const double theta = 100 * kDegree;
  EXPECT_NEAR(end_of("kannala_brandt", {-1 / (3 * theta * theta), 0, 0, 0}), 100, 1e-9);
  EXPECT_NEAR(end_of("kannala_brandt", {0, 0, 0, 0}), 180, 1e-9);
  EXPECT_NEAR(end_of("fov", {1.0}), 180, 1e-9);
  // cos theta = -1 / xi, or -xi.
  EXPECT_NEAR(end_of("mei", {2, 0, 0, 0, 0}), 120, 1e-9);
  EXPECT_NEAR(end_of("mei", {0.5, 0, 0, 0, 0}), 120, 1e-9);
  EXPECT_NEAR(end_of("mei", {0, 0, 0, 0, 0}), 90, 1e-9);
  // Fold of the distortion at m = tan(theta / 2) = 1.
  EXPECT_NEAR(end_of("mei", {1, -1.0 / 3, 0, 0, 0}), 90, 1e-9);
  // alpha = 2/3: cos theta = -(1 - alpha) / alpha = -1/2; with beta: tan theta / sqrt(beta).
  EXPECT_NEAR(end_of("eucm", {2.0 / 3, 1}), 120, 1e-9);
  EXPECT_NEAR(end_of("eucm", {1.0 / 3, 1}), 120, 1e-9);
  EXPECT_NEAR(end_of("eucm", {2.0 / 3, 3}), 135, 1e-9);
  EXPECT_NEAR(end_of("double_sphere", {0, 2.0 / 3}), 120, 1e-9);
  // On the second sphere 120 degrees: (s, c + xi) with xi = 1 has half the angle of (s, c).
  EXPECT_NEAR(end_of("double_sphere", {1, 0}), 180, 1e-6);
  EXPECT_NEAR(end_of("double_sphere", {0.5, 0}), 120, 1e-9);
}

TEST(CameraModelDomain, PixelsBeyondItShowNothing) {
  Eigen::Vector3d ray;
  // 200 px are one radian, half a turn are 628 px.
  const CameraModel fisheye("kannala_brandt", {200, 200, 0, 0, 0, 0, 0, 0}, {640, 480});
  EXPECT_TRUE(fisheye.unproject({628, 0}, ray));
  EXPECT_NEAR(angle_between(ray, {0, 0, 1}), 3.14, 1e-9);
  EXPECT_FALSE(fisheye.unproject({629, 0}, ray));
  // r^2 < 1 / (2 alpha - 1) = 3.
  for (const CameraModel& camera :
       {CameraModel("double_sphere", {100, 100, 0, 0, -0.2, 2.0 / 3}, {640, 480}),
        CameraModel("eucm", {100, 100, 0, 0, 2.0 / 3, 1}, {640, 480})}) {
    EXPECT_TRUE(camera.unproject({173, 0}, ray));
    EXPECT_FALSE(camera.unproject({174, 0}, ray));
  }
  // With xi = 1 the second sphere sees the first from its surface: not beyond 90 degrees.
  const CameraModel surface("double_sphere", {100, 100, 0, 0, 1, 0.5}, {640, 480});
  EXPECT_TRUE(surface.unproject({199, 0}, ray));
  EXPECT_FALSE(surface.unproject({201, 0}, ray));
  // The largest radius is 1 - 1/3 of 300 px.
  const CameraModel barrel("radtan4", {300, 300, 0, 0, -1.0 / 3, 0, 0, 0}, {640, 480});
  EXPECT_TRUE(barrel.unproject({199.9, 0}, ray));
  EXPECT_FALSE(barrel.unproject({200.1, 0}, ray));
}

// ---- angles ----
TEST(CameraModelAngles, PixelsPerRadianOfKnownProjections) {
  const CameraModel pinhole("pinhole", {300, 300, 320, 240}, {640, 480});
  EXPECT_NEAR(pinhole.pixels_per_radian(Eigen::Vector2d(320, 240))(0), 300, 1e-9);
  // At 45 degrees: f / cos^2 along the radius, f / cos across.
  EXPECT_NEAR(pinhole.pixels_per_radian(Eigen::Vector2d(620, 240))(0), 300 * std::pow(2, 0.75),
              1e-9);
  const CameraModel fisheye("kannala_brandt", {300, 300, 320, 240, 0, 0, 0, 0}, {640, 480});
  EXPECT_NEAR(fisheye.pixels_per_radian(Eigen::Vector2d(320, 540))(0),
              300 * std::sqrt(1 / std::sin(1.0)), 1e-9);
}

TEST(CameraModelAngles, AngleOfViewOfKnownProjections) {
  const AngleOfView pinhole =
      CameraModel("pinhole", {320, 320, 319.5, 239.5}, {640, 480}).angle_of_view();
  EXPECT_NEAR(pinhole.horizontal, 90 * kDegree, 1e-12);
  EXPECT_NEAR(pinhole.vertical, 2 * std::atan(0.75), 1e-12);
  EXPECT_NEAR(pinhole.diagonal, 2 * std::atan(1.25), 1e-12);
  // 195 degrees on 600 pixels; the corners beyond 180 degrees from the axis are not reached.
  const double f = 600 / (195 * kDegree);
  const AngleOfView fisheye =
      CameraModel("kannala_brandt", {f, f, 299.5, 299.5, 0, 0, 0, 0}, {600, 600}).angle_of_view();
  EXPECT_NEAR(fisheye.horizontal, 195 * kDegree, 1e-12);
  EXPECT_NEAR(fisheye.diagonal, 195 * std::sqrt(2.0) * kDegree, 1e-12);
  // The end of the model counts where the image reaches beyond it.
  const AngleOfView round =
      CameraModel("eucm", {100, 100, 319.5, 239.5, 2.0 / 3, 1}, {640, 480}).angle_of_view();
  EXPECT_NEAR(round.horizontal, 240 * kDegree, 1e-6);
  EXPECT_NEAR(round.diagonal, 240 * kDegree, 1e-6);
  // An image cut out beside the axis: from 45 degrees to atan 2.
  const AngleOfView beside =
      CameraModel("pinhole", {100, 100, -100.5, 239.5}, {100, 480}).angle_of_view();
  EXPECT_NEAR(beside.horizontal, std::atan(2.0) - 45 * kDegree, 1e-12);
}

}  // namespace
}  // namespace orbslam
