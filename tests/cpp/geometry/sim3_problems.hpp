// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "base/scale_pyramid.hpp"
#include "geometry/sim3_ransac.hpp"
#include "scenes.hpp"

namespace orbslam::testing {

struct SyntheticSim3 {
  Sim3Problem problem;
  Similarity S_12;
  std::vector<bool> outlier;
};

/// Points 2 to 8 m before camera 2, seen a little displaced by camera 1 in a map of another scale.
/// `noise` [m] moves the points of both; outliers are other points in sight of camera 1.
inline SyntheticSim3 make_sim3_problem(int n, double scale, double noise, double outlier_share,
                                       std::uint64_t seed) {
  std::mt19937_64 random(seed);
  SyntheticSim3 synthetic;
  Vector6d xi;
  for (int i = 0; i < 6; ++i) xi(i) = uniform(random, -0.3, 0.3);
  const Pose motion = Pose::exp(xi);
  synthetic.S_12 = Similarity(scale, motion.rotation(), scale * motion.translation());
  Sim3Problem& problem = synthetic.problem;
  problem.camera_1 = make_camera({520, 525, 320, 240});
  problem.camera_2 = make_camera({500, 490, 310, 250});
  problem.points_1.resize(3, n);
  problem.points_2.resize(3, n);
  problem.sigma2_1 = problem.sigma2_2 = Eigen::VectorXd::Ones(n);
  const auto in_sight = [&](const Camera& camera) -> Eigen::Vector3d {
    return camera.unproject(uniform(random, 0, 640), uniform(random, 0, 480),
                            uniform(random, 2, 8));
  };
  const auto shift = [&]() -> Eigen::Vector3d {
    return noise * Eigen::Vector3d(normal(random), normal(random), normal(random));
  };
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector3d p_2 = in_sight(*problem.camera_2);
    synthetic.outlier.push_back(uniform(random, 0, 1) < outlier_share);
    const Eigen::Vector3d p_1 = synthetic.S_12 * p_2;
    problem.points_2.col(i) = p_2 + shift();
    const Eigen::Vector3d elsewhere = scale * in_sight(*problem.camera_1);
    const Eigen::Vector3d near_by = p_1 + scale * shift();
    problem.points_1.col(i) = synthetic.outlier.back() ? elsewhere : near_by;
  }
  return synthetic;
}

inline Pose golden_pose(const std::string& set, const std::string& array) {
  const auto values = golden<double>(set, array).values;
  Eigen::Matrix4d m;
  for (std::size_t i = 0; i < 16; ++i) {
    m(static_cast<int>(i / 4), static_cast<int>(i % 4)) = values[i];
  }
  return Pose::from_matrix(m);
}

inline Eigen::Matrix3Xd golden_points(const std::string& set, const std::string& array,
                                      const Pose& T_cw) {
  const auto X = golden<double>(set, array);
  Eigen::Matrix3Xd points(3, static_cast<Eigen::Index>(X.rows()));
  for (std::size_t i = 0; i < X.rows(); ++i) {
    points.col(static_cast<Eigen::Index>(i)) =
        T_cw * Eigen::Vector3d(X.at(i, 0), X.at(i, 1), X.at(i, 2));
  }
  return points;
}

inline Sim3Problem golden_sim3_problem(const std::string& set) {
  const ScalePyramid scales(1.2F, 8);
  const auto variances = [&](const std::string& array) -> Eigen::VectorXd {
    const auto octaves = golden<int>(set, array);
    Eigen::VectorXd sigma2(static_cast<Eigen::Index>(octaves.rows()));
    for (std::size_t i = 0; i < octaves.rows(); ++i) {
      sigma2[static_cast<Eigen::Index>(i)] = scales.sigma2(octaves.at(i));
    }
    return sigma2;
  };
  Sim3Problem problem;
  problem.points_1 = golden_points(set, "X1w", golden_pose(set, "T1w"));
  problem.points_2 = golden_points(set, "X2w", golden_pose(set, "T2w"));
  problem.sigma2_1 = variances("octave1");
  problem.sigma2_2 = variances("octave2");
  problem.camera_1 = problem.camera_2 = golden_camera(set);
  return problem;
}

}  // namespace orbslam::testing
