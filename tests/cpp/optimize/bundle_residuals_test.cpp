// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/bundle_residuals.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include "optimize/bundle_point.hpp"
#include "optimize/gates.hpp"
#include "support/cameras.hpp"
#include "support/random_numbers.hpp"

namespace orbslam {
namespace {

using testing::uniform;

/// One observation away from the chart's origin, with everything a cost function reads.
struct Scene {
  std::array<double, 6> camera;
  std::array<double, 3> point;
  std::shared_ptr<const Camera> model = testing::make_camera({480, 500, 320, 240}, 40);
  BundleView view{Pose(), *model};
  BundleMeasurement measurement;
  double v_px = 0;

  Scene(std::mt19937_64& random, bool has_depth, double huber) {
    Vector6d xi;
    for (int i = 0; i < 6; ++i) xi(i) = uniform(random, -1, 1);
    view = BundleView(Pose::exp(xi), *model);
    for (double& c : camera) c = uniform(random, -0.3, 0.3);
    view.move(camera.data());
    const double z = std::exp(uniform(random, std::log(0.5), std::log(50.0)));
    const double u = uniform(random, 0, 640), v = uniform(random, 0, 480);
    Eigen::Map<Eigen::Vector3d>{point.data()} = view.T_cw().inverse() * model->unproject(u, v, z);
    measurement.view = &view;
    measurement.point = point.data();
    measurement.u = u + uniform(random, -8, 8);
    v_px = v + uniform(random, -8, 8);
    measurement.sight = model->sight(measurement.u, v_px);
    measurement.right_u = u - 40 / z + uniform(random, -8, 8);
    measurement.has_depth = has_depth;
    measurement.scale = uniform(random, 0.3, 1);
    measurement.huber = huber;
  }
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  double update() {
    view.move(camera.data());
    return measurement.evaluate();
  }
};

TEST(BundleResiduals, BlocksNobodyAsksForAreLeftAlone) {
  std::mt19937_64 random(2);
  Scene scene(random, true, 0);
  scene.update();
  const double* blocks[] = {scene.camera.data(), scene.point.data()};
  double residuals[2], camera[12], point[6];
  double* only_camera[] = {camera, nullptr};
  double* only_point[] = {nullptr, point};
  const ImageResiduals<true> image(&scene.measurement);
  const RightResidual<true> right(&scene.measurement);
  EXPECT_TRUE(image.Evaluate(blocks, residuals, only_camera));
  EXPECT_TRUE(image.Evaluate(blocks, residuals, only_point));
  EXPECT_TRUE(right.Evaluate(blocks, residuals, only_camera));
  EXPECT_TRUE(right.Evaluate(blocks, residuals, only_point));
}

/// Robustified cost of one observation, written independently.
double huber_cost(const Scene& scene, double width) {
  const BundleMeasurement& m = scene.measurement;
  const Eigen::Vector3d p =
      scene.view.T_cw() * Eigen::Map<const Eigen::Vector3d>(scene.point.data());
  const Eigen::Vector2d pixel = scene.model->pinhole().project(p);
  double q = (Eigen::Vector2d(m.u, scene.v_px) - pixel).squaredNorm();
  if (m.has_depth) q += std::pow(m.right_u - (pixel.x() - scene.model->bf() / p.z()), 2);
  q *= m.scale * m.scale;
  return q <= width * width ? q : 2 * width * std::sqrt(q) - width * width;
}

TEST(BundleResiduals, KernelGivesTheCostAndGradientOfHuber) {
  std::mt19937_64 random(3);
  int n_outside = 0;
  for (int trial = 0; trial < 200; ++trial) {
    for (const bool has_depth : {false, true}) {
      const double width = has_depth ? kHuberStereo : kHuberMono;
      Scene scene(random, has_depth, width);
      const double missing = scene.update();
      n_outside += missing > 0 ? 1 : 0;
      const ImageResiduals<true> image(&scene.measurement);
      const RightResidual<true> right(&scene.measurement);
      const MissingCost rest(&missing);
      const double* blocks[] = {scene.camera.data(), scene.point.data()};
      Eigen::Vector2d e_image, e_right, e_rest;
      Eigen::Matrix<double, 2, 6, Eigen::RowMajor> J_image, J_right;
      Eigen::Matrix<double, 2, 3, Eigen::RowMajor> none, J_rest;
      double* image_jacobians[] = {J_image.data(), nullptr};
      double* right_jacobians[] = {J_right.data(), nullptr};
      double* rest_jacobians[] = {J_rest.data()};
      image.Evaluate(blocks, e_image.data(), image_jacobians);
      right.Evaluate(blocks, e_right.data(), right_jacobians);
      rest.Evaluate(blocks + 1, e_rest.data(), rest_jacobians);
      const double cost = e_image.squaredNorm() + e_right.squaredNorm() + e_rest.squaredNorm();
      EXPECT_NEAR(cost, huber_cost(scene, width), 1e-9 * (1 + cost));
      EXPECT_EQ(J_rest.norm(), 0);

      Vector6d gradient = J_image.transpose() * e_image;
      if (has_depth) gradient += J_right.transpose() * e_right;
      for (int i = 0; i < 6; ++i) {
        const double start = scene.camera[static_cast<std::size_t>(i)], step = 1e-6;
        scene.camera[static_cast<std::size_t>(i)] = start + step;
        scene.update();
        const double above = huber_cost(scene, width);
        scene.camera[static_cast<std::size_t>(i)] = start - step;
        scene.update();
        const double below = huber_cost(scene, width);
        scene.camera[static_cast<std::size_t>(i)] = start;
        EXPECT_NEAR(2 * gradient(i), (above - below) / (2 * step), 1e-5 * (1 + gradient.norm()));
      }
      scene.update();
    }
  }
  EXPECT_GT(n_outside, 50);
}

TEST(BundleResiduals, CurvatureIsTheSumOfSquaredColumns) {
  std::mt19937_64 random(4);
  Scene scene(random, true, kHuberStereo);
  scene.update();
  const double* blocks[] = {scene.camera.data(), scene.point.data()};
  Eigen::Vector2d e;
  Eigen::Matrix<double, 2, 6, Eigen::RowMajor> camera, camera_right;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> point, point_right;
  double* jacobians[] = {camera.data(), point.data()};
  double* right_jacobians[] = {camera_right.data(), point_right.data()};
  ImageResiduals<true>(&scene.measurement).Evaluate(blocks, e.data(), jacobians);
  RightResidual<true>(&scene.measurement).Evaluate(blocks, e.data(), right_jacobians);
  Vector6d pose_diagonal = Vector6d::Zero();
  Eigen::Vector3d point_diagonal = Eigen::Vector3d::Zero();
  scene.measurement.add_curvature(pose_diagonal, point_diagonal);
  const Vector6d pose_expected =
      (camera.colwise().squaredNorm() + camera_right.colwise().squaredNorm()).transpose();
  const Eigen::Vector3d point_expected =
      (point.colwise().squaredNorm() + point_right.colwise().squaredNorm()).transpose();
  EXPECT_LT((pose_diagonal - pose_expected).norm(), 1e-9 * pose_expected.norm());
  EXPECT_LT((point_diagonal - point_expected).norm(), 1e-9 * point_expected.norm());
}

TEST(BundleResiduals, DerivativesByInverseDepthAreThoseOfTheResiduals) {
  std::mt19937_64 random(7);
  for (int trial = 0; trial < 100; ++trial) {
    Scene scene(random, true, 0);
    const Eigen::Map<const Eigen::Vector3d> start(scene.point.data());
    BundlePoint chart(scene.view.T_cw().center() + Eigen::Vector3d(0.3, 0.1, -0.2), start);
    scene.measurement.point = chart.position().data();
    scene.measurement.chart = &chart.jacobian();
    std::array<double, 3> at{};
    for (double& parameter : at) parameter = uniform(random, -0.02, 0.02);
    const ImageResiduals<true> image(&scene.measurement);
    const RightResidual<true> right(&scene.measurement);
    const auto residuals = [&](const std::array<double, 3>& parameters) {
      chart.move(parameters.data());
      scene.update();
      Eigen::Vector4d e;
      image.Evaluate(nullptr, e.data(), nullptr);
      right.Evaluate(nullptr, e.data() + 2, nullptr);
      return e;
    };
    residuals(at);
    Eigen::Matrix<double, 4, 3, Eigen::RowMajor> J;
    Eigen::Vector2d e;
    double* image_jacobians[] = {nullptr, J.data()};
    double* right_jacobians[] = {nullptr, J.data() + 6};
    image.Evaluate(nullptr, e.data(), image_jacobians);
    right.Evaluate(nullptr, e.data(), right_jacobians);
    for (std::size_t i = 0; i < 3; ++i) {
      const double step = 1e-6;
      std::array<double, 3> more = at, less = at;
      more[i] += step;
      less[i] -= step;
      const Eigen::Vector4d numeric = (residuals(more) - residuals(less)) / (2 * step);
      EXPECT_LT((numeric - J.col(static_cast<int>(i))).norm(), 1e-5 * (1 + numeric.norm()));
    }
  }
}

TEST(BundleResiduals, PointOnTheCameraPlaneIsHarmless) {
  std::mt19937_64 random(5);
  Scene scene(random, true, kHuberStereo);
  Eigen::Map<Eigen::Vector3d>{scene.point.data()} = scene.view.T_cw().center();
  scene.update();
  const double* blocks[] = {scene.camera.data(), scene.point.data()};
  Eigen::Vector2d e;
  Eigen::Matrix<double, 2, 6, Eigen::RowMajor> camera;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> point;
  double* jacobians[] = {camera.data(), point.data()};
  ImageResiduals<true>(&scene.measurement).Evaluate(blocks, e.data(), jacobians);
  EXPECT_EQ(e.norm(), 0);
  EXPECT_EQ(camera.norm(), 0);
  EXPECT_EQ(point.norm(), 0);
}

TEST(BundleView, ChartStartsAtThePose) {
  std::mt19937_64 random(6);
  Vector6d xi;
  for (int i = 0; i < 6; ++i) xi(i) = uniform(random, -2, 2);
  const Pose T_cw = Pose::exp(xi);
  const auto model = testing::make_camera({480, 500, 320, 240}, 40);
  BundleView view(T_cw, *model);
  EXPECT_LT((view.T_cw().matrix() - T_cw.matrix()).norm(), 1e-14);
  // To first order the parameters are the left tangent.
  for (int i = 0; i < 6; ++i) {
    Vector6d small = Vector6d::Zero();
    small(i) = 1e-5;
    view.move(small.data());
    EXPECT_LT((view.T_cw().matrix() - (Pose::exp(small) * T_cw).matrix()).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace orbslam
