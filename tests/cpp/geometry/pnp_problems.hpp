// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/LU>

#include "base/scale_pyramid.hpp"
#include "geometry/pnp_ransac.hpp"
#include "scenes.hpp"

namespace orbslam::testing {

enum class PnpShape { general, planar, slab };  // slab: a plane with 1 mm of relief

struct SyntheticPnp {
  PnpProblem problem;
  Pose T_cw;
  std::vector<bool> outlier;
};

/// Points 2 to 8 m away in a 640x480 image; outliers are pixels anywhere in it.
inline SyntheticPnp make_pnp_problem(PnpShape shape, int n, double noise, double outlier_share,
                                     std::uint64_t seed) {
  std::mt19937_64 random(seed);
  SyntheticPnp synthetic;
  Vector6d xi;
  for (int i = 0; i < 6; ++i) xi(i) = uniform(random, -1, 1);
  synthetic.T_cw = Pose::exp(xi);
  const Pose T_wc = synthetic.T_cw.inverse();
  PnpProblem& problem = synthetic.problem;
  problem.camera = make_camera({520, 525, 320, 240});
  problem.points.resize(3, n);
  problem.pixels.resize(2, n);
  problem.sigma2 = Eigen::VectorXd::Ones(n);
  const Eigen::Vector3d normal_c(uniform(random, -0.5, 0.5), uniform(random, -0.5, 0.5), -1);
  for (int i = 0; i < n; ++i) {
    const double u = uniform(random, 0, 640), v = uniform(random, 0, 480);
    const Eigen::Vector3d ray = problem.camera->unproject(u, v, 1);
    Eigen::Vector3d p_c = uniform(random, 2, 8) * ray;
    if (shape != PnpShape::general) p_c = -5 / normal_c.dot(ray) * ray;
    if (shape == PnpShape::slab) p_c += 1e-3 * normal(random) * normal_c.normalized();
    problem.points.col(i) = T_wc * p_c;
    synthetic.outlier.push_back(uniform(random, 0, 1) < outlier_share);
    const Eigen::Vector2d shift(noise * normal(random), noise * normal(random));
    problem.pixels.col(i) = problem.camera->pinhole().project(p_c) + shift;
    if (synthetic.outlier.back()) {
      problem.pixels.col(i) = Eigen::Vector2d(uniform(random, 0, 640), uniform(random, 0, 480));
    }
  }
  return synthetic;
}

inline PnpProblem golden_pnp_problem() {
  const auto X = golden<double>("pnp", "X"), uv = golden<double>("pnp", "uv");
  const auto octave = golden<int>("pnp", "octave");
  const ScalePyramid scales(1.2F, 8);
  const auto n = static_cast<int>(X.rows());
  PnpProblem problem;
  problem.camera = golden_camera("pnp");
  problem.points.resize(3, n);
  problem.pixels.resize(2, n);
  problem.sigma2.resize(n);
  for (int i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    problem.points.col(i) << X.at(k, 0), X.at(k, 1), X.at(k, 2);
    problem.pixels.col(i) << uv.at(k, 0), uv.at(k, 1);
    problem.sigma2[i] = scales.sigma2(octave.at(k));
  }
  return problem;
}

}  // namespace orbslam::testing
