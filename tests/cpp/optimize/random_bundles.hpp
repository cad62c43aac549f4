// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "optimize/bundle_adjustment.hpp"
#include "support/cameras.hpp"
#include "support/random_numbers.hpp"

namespace orbslam::testing {

/// Cameras in a row that look at a box of points; poses and points are disturbed.
inline BundleProblem random_bundle(std::uint64_t seed, std::size_t n_cameras, std::size_t n_points,
                                   std::size_t n_fixed, bool with_depth,
                                   TestLens lens = TestLens::none) {
  std::mt19937_64 random(seed);
  const auto model =
      lens == TestLens::none ? make_camera({500, 500, 320, 240}, 40) : make_camera(lens, 40);
  BundleProblem problem;
  std::vector<Pose> truth;
  for (std::size_t i = 0; i < n_cameras; ++i) {
    const Pose T_cw(Eigen::Quaterniond::Identity(),
                    Eigen::Vector3d(-0.3 * static_cast<double>(i), 0, 0));
    truth.push_back(T_cw);
    Vector6d xi;
    for (int k = 0; k < 6; ++k) xi(k) = uniform(random, -0.01, 0.01);
    const bool fixed = i < n_fixed;
    problem.cameras.push_back({fixed ? T_cw : Pose::exp(xi) * T_cw, model, fixed});
  }
  for (std::size_t i = 0; i < n_points; ++i) {
    const Eigen::Vector3d point(uniform(random, -1, 3), uniform(random, -2, 2),
                                uniform(random, 3, 9));
    for (std::size_t c = 0; c < n_cameras; ++c) {
      const Eigen::Vector3d p_c = truth[c] * point;
      Eigen::Vector2d pixel;
      if (!model->project(p_c, pixel)) continue;
      BundleProblem::Observation o;
      o.camera = static_cast<std::uint32_t>(c);
      o.point = static_cast<std::uint32_t>(i);
      o.u = static_cast<float>(pixel.x() + uniform(random, -0.5, 0.5));
      o.v = static_cast<float>(pixel.y() + uniform(random, -0.5, 0.5));
      o.has_depth = with_depth && (i + c) % 2 == 0;
      o.right_u = static_cast<float>(pixel.x() - 40 / p_c.z() + uniform(random, -0.5, 0.5));
      problem.observations.push_back(o);
    }
    problem.points.push_back(point + 0.05 * Eigen::Vector3d(uniform(random, -1, 1),
                                                            uniform(random, -1, 1),
                                                            uniform(random, -1, 1)));
  }
  return problem;
}

inline std::vector<double> numbers(const BundleProblem& problem) {
  std::vector<double> all;
  for (const auto& camera : problem.cameras) {
    const Eigen::Matrix4d m = camera.T_cw.matrix();
    all.insert(all.end(), m.data(), m.data() + 16);
  }
  for (const auto& point : problem.points) all.insert(all.end(), point.data(), point.data() + 3);
  return all;
}

inline bool all_finite(const BundleProblem& problem) {
  const std::vector<double> all = numbers(problem);
  return std::all_of(all.begin(), all.end(), [](double x) { return std::isfinite(x); });
}

}  // namespace orbslam::testing
