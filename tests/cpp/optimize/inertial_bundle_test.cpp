// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <random>

#include "optimize/bundle_adjustment.hpp"
#include "optimize/inertial_system.hpp"
#include "support/analytic_motion.hpp"
#include "support/cameras.hpp"

namespace orbslam {
namespace {

using testing::AnalyticMotion;
using testing::kBias;
using testing::kNoise;
using testing::kT_cb;
using testing::normal;
using testing::uniform;

constexpr double kStep = 0.25;

Pose camera_at(double t) {
  return kT_cb * Pose(AnalyticMotion::rotation(t), AnalyticMotion::position(t)).inverse();
}

/// One camera sees points on its way; all but the first pose are unknown, and the map is 3 % too
/// large.
BundleProblem one_camera(int n_cameras, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  BundleProblem problem;
  const auto model = testing::make_camera({500, 500, 320, 240}, 0);
  const Eigen::Vector3d origin = camera_at(0).center();
  const auto grown = [&](const Eigen::Vector3d& p) { return origin + 1.03 * (p - origin); };
  for (int i = 0; i < n_cameras; ++i) {
    const double t = kStep * i;
    const Pose truth = camera_at(t);
    const Pose start(truth.rotation(), -(truth.rotation() * grown(truth.center())));
    problem.cameras.push_back({start, model, i == 0});
    BundleProblem::Motion motion;
    motion.camera = static_cast<std::uint32_t>(i);
    motion.velocity = AnalyticMotion::velocity(t) + 0.1 * Eigen::Vector3d(normal(random), 0, 0);
    motion.bias = {kBias.gyro + Eigen::Vector3d::Constant(2e-3),
                   kBias.accel + Eigen::Vector3d::Constant(0.03)};
    motion.bias_information << Eigen::Vector3d::Constant(1e4), Eigen::Vector3d::Constant(1e2);
    problem.inertial.motions.push_back(motion);
    if (i == 0) continue;
    const auto samples =
        testing::measured(AnalyticMotion::samples(t - kStep, t, 50), kNoise, kBias, random);
    problem.inertial.links.push_back(
        {motion.camera - 1, motion.camera,
         std::make_shared<Preintegration>(samples, kNoise, motion.bias)});
  }
  problem.inertial.T_cb = kT_cb;
  problem.inertial.gravity = testing::kFall;
  for (std::uint32_t k = 0; k < 300; ++k) {
    // In view of one of the cameras, and of others by chance.
    const Pose T_wc = camera_at(kStep * (k % static_cast<std::uint32_t>(n_cameras))).inverse();
    const Eigen::Vector3d point =
        T_wc *
        model->unproject(uniform(random, 50, 590), uniform(random, 50, 430), uniform(random, 2, 8));
    problem.points.push_back(grown(point));
    for (int i = 0; i < n_cameras; ++i) {
      const Eigen::Vector3d p = camera_at(kStep * i) * point;
      const double u = 500 * p.x() / p.z() + 320, v = 500 * p.y() / p.z() + 240;
      if (p.z() < 0.5 || u < 0 || u > 640 || v < 0 || v > 480) continue;
      BundleProblem::Observation o;
      o.camera = static_cast<std::uint32_t>(i);
      o.point = k;
      o.u = static_cast<float>(u + 0.5 * normal(random));
      o.v = static_cast<float>(v + 0.5 * normal(random));
      problem.observations.push_back(o);
    }
  }
  return problem;
}

double scale_of(const BundleProblem& problem) {
  double size = 0, truth = 0;
  for (std::size_t i = 1; i < problem.cameras.size(); ++i) {
    size += (problem.cameras[i].T_cw.center() - camera_at(0).center()).norm();
    truth += (camera_at(kStep * static_cast<double>(i)).center() - camera_at(0).center()).norm();
  }
  return size / truth;
}

TEST(InertialBundle, OneCameraBecomesMetric) {
  BundleProblem problem = one_camera(30, 1);
  EXPECT_NEAR(scale_of(problem), 1.03, 1e-6);
  BundleOptions options;
  options.final_iterations = 20;
  solve_bundle(problem, options, nullptr);
  EXPECT_NEAR(scale_of(problem), 1, 0.01);
  for (const auto& motion : problem.inertial.motions) {
    const double t = kStep * motion.camera;
    EXPECT_LT((motion.velocity - AnalyticMotion::velocity(t)).norm(), 0.03);
    EXPECT_LT((motion.bias.gyro - kBias.gyro).norm(), 1.5e-3);
  }
}

TEST(InertialBundle, FixedMotionsStay) {
  BundleProblem problem = one_camera(6, 2);
  problem.inertial.motions[0].fixed = true;
  const Eigen::Vector3d before = problem.inertial.motions[0].velocity;
  solve_bundle(problem, {}, nullptr);
  EXPECT_EQ(problem.inertial.motions[0].velocity, before);
  EXPECT_NE(problem.inertial.motions[1].velocity, one_camera(6, 2).inertial.motions[1].velocity);
}

TEST(InertialBundle, TwoThreadsGiveTheSameBytes) {
  BundleProblem one = one_camera(8, 3), two = one;
  BundleOptions options;
  solve_bundle(one, options, nullptr);
  options.n_threads = 2;
  solve_bundle(two, options, nullptr);
  for (std::size_t i = 0; i < one.cameras.size(); ++i) {
    EXPECT_EQ(one.cameras[i].T_cw.matrix(), two.cameras[i].T_cw.matrix());
    EXPECT_EQ(one.inertial.motions[i].velocity, two.inertial.motions[i].velocity);
  }
}

TEST(InertialSystem, TheGradientIsThatOfTheCost) {
  const BundleProblem problem = one_camera(4, 4);
  const std::vector<std::uint32_t> free{1, 2, 3};
  std::vector<Pose> poses;
  for (const std::uint32_t camera : free) poses.push_back(problem.cameras[camera].T_cw);
  InertialSystem system(problem, free);
  const Eigen::Index n = system.n_unknowns();
  ASSERT_EQ(n, 3 * 6 + 4 * 9);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(n);
  system.linearise(poses, H, b);
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto cost_at = [&](double h) {
      Eigen::VectorXd step = Eigen::VectorXd::Zero(n);
      step(k) = h;
      std::vector<Pose> moved = poses;
      for (std::size_t i = 0; i < moved.size(); ++i) {
        const Vector6d xi = step.segment<6>(static_cast<Eigen::Index>(6 * i));
        moved[i] = Pose::exp(xi) * moved[i];
      }
      system.move(step);
      return system.cost(moved, true);
    };
    const double h = 1e-6;
    const double slope = (cost_at(h) - cost_at(-h)) / (2 * h);
    EXPECT_NEAR(-2 * b(k), slope, 1e-5 * std::abs(slope) + 1e-2 * std::sqrt(H(k, k))) << k;
  }
}

}  // namespace
}  // namespace orbslam
