// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera_model.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <ostream>
#include <set>
#include <string>
#include <vector>

#include "support/directions.hpp"

namespace orbslam {
namespace {

using testing::angle_between;
using testing::direction;
using testing::kDegree;

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

}  // namespace
}  // namespace orbslam
