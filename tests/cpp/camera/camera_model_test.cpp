// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera_model.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <ostream>
#include <set>
#include <string>
#include <vector>

#include "base/errors.hpp"

namespace orbslam {
namespace {

constexpr double kDegree = lens_models::kPi / 180;

/// A calibration of a real or of a thinkable lens.
struct Calibration {
  const char* label;
  const char* model;
  std::vector<double> parameters;
  ImageSize size;
  double least_shown;  ///< least part of the pixels that show a ray

  CameraModel camera() const { return {model, parameters, size}; }
};

void PrintTo(const Calibration& one, std::ostream* out) { *out << one.label; }

const std::vector<Calibration>& calibrations() {
  static const std::vector<Calibration> all{
      {"Kitti", "pinhole", {718.856, 718.856, 607.1928, 185.2157}, {1241, 376}, 1},
      {"EurocRadtan",
       "radtan4",
       {458.654, 457.296, 367.215, 248.375, -0.28340811, 0.07395907, 0.00019359, 1.76187114e-05},
       {752, 480},
       1},
      {"Tum1",
       "radtan5",
       {517.306408, 516.469215, 318.643040, 255.313989, 0.262383, -0.953104, -0.005358, 0.002628,
        1.163314},
       {640, 480},
       1},
      {"EurocRational",
       "rational",
       {460.78555617278914, 459.42666116186285, 365.8944076750287, 249.32995554428132,
        1.1748900368210342, 0.2857484292561828, 3.608102710096627e-10, -1.837092112796882e-10,
        0.007606563691092208, 1.5082142792043303, 0.5817504412252055, 0.046603381504174014},
       {752, 480},
       1},
      {"DepthCameraRational",
       "rational",
       {975.6, 975.5, 1021.8, 779.1, 0.4827, -2.4756, 0.0006, -0.0002, 1.4918, 0.3635, -2.3092,
        1.4214},
       {2048, 1536},
       1},
      {"RationalWithPole",
       "rational",
       {300, 300, 320, 240, 0, 0, 0.001, 0, 0, -0.5, 0, 0},
       {640, 480},
       1},
      {"ThinPrism",
       "thin_prism",
       {600, 605, 330, 236, -0.21, 0.06, 0.0011, -0.0007, 0.003, 0.05, -0.01, 0.002, 0.0012,
        -0.0004, -0.0009, 0.0003},
       {640, 480},
       1},
      {"TumVi",
       "kannala_brandt",
       {190.97847715128717, 190.9733070521226, 254.93170605935475, 256.8974428996504,
        0.0034823894022493434, 0.0007150348452162257, -0.0020532361418706202,
        0.00020293673591811182},
       {512, 512},
       1},
      {"T265",
       "kannala_brandt",
       {286.60144163375528, 286.4617087423328, 422.2765876951761, 395.2246466040553,
        -0.006762412326815424, 0.045170283325720008, -0.043515167278210638, 0.008374959821591333},
       {848, 800},
       0.9},
      {"Equidistant250Degrees",
       "kannala_brandt",
       {220, 221, 479.5, 479.5, 0, 0, 0, 0},
       {960, 960},
       1},
      {"EurocDoubleSphere",
       "double_sphere",
       {349.7560023050409, 348.72454229977037, 365.89440762590149, 249.32995565708704,
        -0.2409573942178872, 0.566996899163044},
       {752, 480},
       1},
      {"TumViDoubleSphere",
       "double_sphere",
       {158.28600034966977, 158.2743455478755, 254.96116578191653, 256.8894394501779,
        -0.17213086034353243, 0.5931177593944744},
       {512, 512},
       0.95},
      {"DoubleSphereOfSmallAlpha", "double_sphere", {200, 200, 320, 240, 0.3, 0.2}, {640, 480}, 1},
      {"TumViEucm",
       "eucm",
       {191.14799836282189, 191.13150963902818, 254.9585771534443, 256.88154645599448,
        0.6291060881178562, 1.0418067381860868},
       {512, 512},
       0.9},
      {"EucmOfSmallAlpha", "eucm", {300, 300, 320, 240, 0.3, 0.8}, {640, 480}, 1},
      {"Mei",
       "mei",
       {1127.1, 1126.9, 651.2, 478.6, 1.71, -0.0721, 0.1094, 0.00042, -0.00031},
       {1280, 960},
       0.9},
      {"MeiOfSmallXi",
       "mei",
       {620, 622, 371, 243, 0.62, -0.09, 0.02, 0.0003, 0.0004},
       {752, 480},
       1},
      {"Fov", "fov", {446.7, 714.5, 635.8, 511.7, 0.9372}, {1280, 1024}, 1},
      {"WideFov", "fov", {240, 240, 319.5, 319.5, 1.5}, {640, 640}, 1},
  };
  return all;
}

class EachCameraModel : public ::testing::TestWithParam<Calibration> {
 protected:
  const CameraModel camera_ = GetParam().camera();
};

Eigen::Vector3d direction(double theta, double phi) {
  return {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
}

double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

/// Ratio of the singular values of J.
double least_ratio(const Eigen::Matrix<double, 2, 3>& J) {
  const Eigen::Matrix2d A = J * J.transpose();
  const double half = 0.5 * A.trace(), det = A(0, 0) * A(1, 1) - A(0, 1) * A(1, 0);
  const double larger = half + std::sqrt(std::max(0.0, half * half - det));
  return std::sqrt(std::max(0.0, det)) / larger;
}

TEST_P(EachCameraModel, EveryPixelIsShownByItsRay) {
  int all = 0, shown = 0;
  for (double v = -0.5; v <= GetParam().size.height; v += 9.25) {
    for (double u = -0.5; u <= GetParam().size.width; u += 9.25, ++all) {
      Eigen::Vector3d ray;
      if (!camera_.unproject({u, v}, ray)) continue;
      ++shown;
      ASSERT_NEAR(ray.norm(), 1, 1e-12) << u << ", " << v;
      for (const double distance : {1.0, 37.5}) {
        Seen seen;
        ASSERT_TRUE(camera_.project(distance * ray, seen)) << u << ", " << v;
        ASSERT_NEAR((seen.uv - Eigen::Vector2d(u, v)).norm(), 0, 1e-7) << u << ", " << v;
      }
    }
  }
  EXPECT_GE(shown, GetParam().least_shown * all);
}

TEST_P(EachCameraModel, EveryRayIsFoundAgainUpToTheEndOfTheDomain) {
  for (int phi = 0; phi < 360; phi += 15) {
    bool inside = true;
    for (double theta = 0; theta < 180; theta += 0.5) {
      const Eigen::Vector3d ray = direction(theta * kDegree, phi * kDegree);
      Seen seen;
      const bool now = camera_.project(2.5 * ray, seen);
      ASSERT_FALSE(now && !inside) << "domain with a hole at " << theta << ", " << phi;
      inside = now;
      if (!inside) continue;
      // Where the image hardly moves with the ray, rounding decides which ray is found.
      if (least_ratio(seen.J) < 1e-4) continue;
      Eigen::Vector3d found;
      ASSERT_TRUE(camera_.unproject(seen.uv, found)) << theta << ", " << phi;
      ASSERT_LT(angle_between(ray, found), 1e-7) << theta << ", " << phi;
    }
  }
}

TEST_P(EachCameraModel, JacobianEqualsCentralDifferences) {
  int compared = 0;
  for (const double distance : {0.3, 8.0}) {
    for (int phi = 7; phi < 360; phi += 40) {
      for (double theta = 0; theta < 175; theta += 3) {
        const Eigen::Vector3d point = distance * direction(theta * kDegree, phi * kDegree);
        const double step = 1e-5 * distance;
        Seen seen;
        if (!camera_.project(point, seen)) continue;
        Eigen::Matrix<double, 2, 3> differences;
        bool inside = true;
        for (int i = 0; i < 3; ++i) {
          Seen before, after;
          const Eigen::Vector3d move = step * Eigen::Vector3d::Unit(i);
          inside = inside && camera_.project(point - move, before) &&
                   camera_.project(point + move, after);
          differences.col(i) = (after.uv - before.uv) / (2 * step);
        }
        // Near the plane z = 0 a pinhole's higher derivatives are large.
        if (!inside || seen.J.norm() * distance > 1e5) continue;
        ++compared;
        ASSERT_LT((seen.J - differences).norm(), 1e-5 * seen.J.norm())
            << theta << ", " << phi << ", " << distance;
      }
    }
  }
  EXPECT_GT(compared, 150);
}

TEST_P(EachCameraModel, RefusesPointsOutsideOfItsDomain) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Eigen::Vector3d> none{{0, 0, 0},   {0, 0, -1},  {nan, 0, 1},
                                          {0, nan, 1}, {0, 0, nan}, {1, 0, nan}};
  for (const Eigen::Vector3d& point : none) {
    Seen seen;
    EXPECT_FALSE(camera_.project(point, seen)) << point.transpose();
  }
}

TEST_P(EachCameraModel, BatchesEqualSinglePoints) {
  Eigen::Matrix3Xd points(3, 4);
  points << 0.1, -2, 0, 0,  //
      0.2, 1, 0, 0,         //
      1, 6, -1, 3;
  Eigen::Matrix2Xd pixels(2, 4);
  Eigen::Matrix<double, 6, Eigen::Dynamic> jacobians(6, 4);
  camera_.project(points, pixels, &jacobians);
  Eigen::Matrix3Xd rays(3, 4);
  camera_.unproject(pixels, rays);
  const Eigen::VectorXd scales = camera_.pixels_per_radian(pixels);
  for (int i = 0; i < 4; ++i) {
    Seen seen;
    if (!camera_.project(points.col(i), seen)) {
      EXPECT_EQ(i, 2);
      EXPECT_TRUE(pixels.col(i).array().isNaN().all());
      EXPECT_TRUE(jacobians.col(i).array().isNaN().all());
      EXPECT_TRUE(rays.col(i).array().isNaN().all());
      EXPECT_TRUE(std::isnan(scales(i)));
      continue;
    }
    EXPECT_EQ(pixels.col(i), seen.uv);
    EXPECT_EQ(jacobians.col(i).head<3>(), seen.J.row(0).transpose());
    EXPECT_EQ(jacobians.col(i).tail<3>(), seen.J.row(1).transpose());
    EXPECT_LT(angle_between(rays.col(i), points.col(i)), 1e-9);
    EXPECT_GT(scales(i), 50);
  }
}

// The area in the image of a small square of directions, over its solid angle.
TEST_P(EachCameraModel, PixelsPerRadianAreTheRootOfTheArea) {
  const Eigen::Vector2d pixel(0.7 * GetParam().size.width, 0.4 * GetParam().size.height);
  Eigen::Vector3d ray;
  ASSERT_TRUE(camera_.unproject(pixel, ray));
  const double half = 1e-4;
  const Eigen::Vector3d a = ray.unitOrthogonal(), b = ray.cross(a);
  Seen left, right, above, below;
  ASSERT_TRUE(camera_.project(ray - half * a, left) && camera_.project(ray + half * a, right));
  ASSERT_TRUE(camera_.project(ray - half * b, above) && camera_.project(ray + half * b, below));
  const Eigen::Vector2d across = right.uv - left.uv, down = below.uv - above.uv;
  const double area = std::abs(across.x() * down.y() - across.y() * down.x());
  const double expected = std::sqrt(area) / (2 * half);
  EXPECT_NEAR(camera_.pixels_per_radian(pixel)(0), expected, 1e-5 * expected);
}

INSTANTIATE_TEST_SUITE_P(Lenses, EachCameraModel, ::testing::ValuesIn(calibrations()),
                         [](const auto& one) { return std::string(one.param.label); });

TEST(CameraModels, AllAreTested) {
  std::set<std::string> tested, known;
  for (const Calibration& one : calibrations()) tested.insert(one.model);
  for (const CameraModelRow& row : camera_model_rows()) known.insert(row.name);
  EXPECT_EQ(tested, known);
}

// ---- values of the published formulas, by hand
// ---------------------------------------------------
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

// ---- ends of the domains
// -------------------------------------------------------------------------
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

// ---- angles
// --------------------------------------------------------------------------------------
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

// ---- errors
// --------------------------------------------------------------------------------------
std::string message(const std::string& model, const std::vector<double>& parameters,
                    ImageSize size = {640, 480}) {
  try {
    const CameraModel camera(model, parameters, size);
  } catch (const SettingsError& error) {
    return error.what();
  }
  return "no error";
}

using ::testing::AllOf;
using ::testing::EndsWith;
using ::testing::HasSubstr;

TEST(CameraModelErrors, NameModelParameterAndRemedy) {
  EXPECT_THAT(message("fishy", {}), AllOf(HasSubstr("'fishy'"), HasSubstr("kannala_brandt")));
  EXPECT_THAT(message("KannalaBrandt8", {300, 300, 320, 240, 0.1}),
              AllOf(HasSubstr("KannalaBrandt8 (kannala_brandt) has 8 parameters, got 5"),
                    EndsWith("give fx, fy, cx, cy, k1, k2, k3, k4")));
  EXPECT_THAT(
      message("PinHole", {300, 300, 320, 240, 0.1, 0, 0, 0}),
      EndsWith("give fx, fy, cx, cy, or the model radtan4 (fx, fy, cx, cy, k1, k2, p1, p2)"));
  EXPECT_THAT(message("double_sphere", {300, 300, 320, 240, -1.2, 0.5}),
              AllOf(HasSubstr("double_sphere: xi is -1.2"), HasSubstr("from -1 to 1")));
  EXPECT_THAT(message("eucm", {300, 300, 320, 240, 1.2, 0.5}),
              AllOf(HasSubstr("eucm: alpha is 1.2"), HasSubstr("from 0 to 1")));
  EXPECT_THAT(message("eucm", {300, 300, 320, 240, 0.5, 0}),
              AllOf(HasSubstr("beta is 0"), HasSubstr("above 0")));
  EXPECT_THAT(message("mei", {300, 300, 320, 240, -0.1, 0, 0, 0, 0}),
              AllOf(HasSubstr("xi is -0.1"), HasSubstr("not below 0")));
  EXPECT_THAT(message("fov", {300, 300, 320, 240, 3.2}), HasSubstr("omega is 3.2"));
  EXPECT_THAT(message("pinhole", {-300, 300, 320, 240}),
              AllOf(HasSubstr("fx is -300"), HasSubstr("above 0")));
  EXPECT_THAT(message("pinhole", {300, 300, NAN, 240}),
              AllOf(HasSubstr("cx is nan"), HasSubstr("finite")));
  EXPECT_THAT(message("radtan4", {300, 300, 320, 240, INFINITY, 0, 0, 0}), HasSubstr("k1 is inf"));
  EXPECT_THAT(message("pinhole", {300, 300, 320, 240}, {640, 0}), HasSubstr("640x0"));
}

// xi, fx, fy, cx, cy as Kalibr writes them for this model; and values relative to the image size.
TEST(CameraModelErrors, FocalLengthsInAnotherPlaceOrUnit) {
  EXPECT_THAT(message("mei", {1.2, 460, 459, 365, 249, 0, 0, 0, 0}),
              AllOf(HasSubstr("fx 1.2 and fy 460"), HasSubstr("in the order fx, fy, cx, cy, xi")));
  EXPECT_THAT(message("fov", {0.35, 0.56, 0.5, 0.5, 0.9}), HasSubstr("in pixels"));
}

TEST(CameraModelNames, OtherProgramsNamesGiveTheSameModel) {
  const std::vector<double> parameters{300, 300, 320, 240, 0.1, 0.01, 0, 0};
  const CameraModel camera("kannala_brandt", parameters, {640, 480});
  for (const char* alias : {"KannalaBrandt8", "EQUIDISTANT", "kb4", "OPENCV_FISHEYE"}) {
    EXPECT_TRUE(CameraModel(alias, parameters, {640, 480}) == camera) << alias;
  }
  EXPECT_FALSE(CameraModel("radtan4", parameters, {640, 480}) == camera);
  EXPECT_FALSE(CameraModel("kannala_brandt", parameters, {640, 481}) == camera);
}

}  // namespace
}  // namespace orbslam
