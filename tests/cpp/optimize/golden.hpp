// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "base/scale_pyramid.hpp"
#include "optimize/bundle_adjustment.hpp"
#include "optimize/pose_optimization.hpp"
#include "support/cameras.hpp"
#include "support/npy.hpp"

namespace orbslam::testing {

inline Pose pose_at(const Array<double>& matrices, std::size_t index) {
  Eigen::Matrix4d m;
  for (std::size_t i = 0; i < 16; ++i) {
    m(static_cast<int>(i / 4), static_cast<int>(i % 4)) = matrices.values[16 * index + i];
  }
  return Pose::from_matrix(m);
}

template <class T>
Array<T> golden(const std::string& set, const std::string& array) {
  return read_npy<T>(test_data("golden/" + set + "/" + array + ".npy"));
}

/// From fx, fy, cx, cy and, where a set has depth, bf.
inline std::shared_ptr<const Camera> golden_camera(const Array<double>& K) {
  const double bf = K.values.size() > 4 ? K.values[4] : 0;
  return make_camera({K.values[0], K.values[1], K.values[2], K.values[3]}, bf);
}

struct PoseProblem {
  Pose T_cw_initial;
  std::shared_ptr<const Camera> camera;
  std::vector<PoseObservation> observations;
  Pose T_cw_expected;
  std::vector<std::uint8_t> outlier_expected;
};

inline PoseProblem golden_pose_problem(const std::string& set) {
  const ScalePyramid scales(1.2F, 8);
  const auto K = golden<double>(set, "K"), X = golden<double>(set, "X");
  const auto uv = golden<double>(set, "uv"), ur = golden<double>(set, "ur");
  const auto octave = golden<int>(set, "octave");
  PoseProblem problem;
  problem.camera = golden_camera(K);
  problem.T_cw_initial = pose_at(golden<double>(set, "Tcw_init"), 0);
  problem.T_cw_expected = pose_at(golden<double>(set, "out_Tcw"), 0);
  problem.outlier_expected = golden<std::uint8_t>(set, "out_outlier").values;
  for (std::size_t i = 0; i < X.rows(); ++i) {
    PoseObservation o;
    o.position = {X.at(i, 0), X.at(i, 1), X.at(i, 2)};
    o.u = uv.at(i, 0);
    o.v = uv.at(i, 1);
    o.right_u = ur.at(i);
    o.has_depth = ur.at(i) >= 0;
    o.inverse_sigma2 = scales.inverse_sigma2(octave.at(i));
    problem.observations.push_back(o);
  }
  return problem;
}

struct GoldenBundle {
  BundleProblem problem;
  std::vector<Pose> T_cw_expected;
  std::vector<Eigen::Vector3d> points_expected;
  std::vector<std::uint8_t> erased_expected;  ///< per observation
  std::size_t first_local = 0;
};

inline GoldenBundle golden_bundle(const std::string& set) {
  const ScalePyramid scales(1.2F, 8);
  const auto K = golden<double>(set, "K");
  const auto T_cw = golden<double>(set, "Tcw_init"), T_out = golden<double>(set, "out_Tcw");
  const auto X = golden<double>(set, "X_init"), X_out = golden<double>(set, "out_X");
  const auto obs_kf = golden<int>(set, "obs_kf"), obs_pt = golden<int>(set, "obs_pt");
  const auto octave = golden<int>(set, "obs_octave");
  const auto uvr = golden<float>(set, "obs_uvr");
  const auto model = golden_camera(K);
  GoldenBundle bundle;
  bundle.first_local = static_cast<std::size_t>(golden<int>(set, "local_from").values[0]);
  for (std::size_t i = 0; i < T_cw.shape[0]; ++i) {
    BundleProblem::Camera camera;
    camera.T_cw = pose_at(T_cw, i);
    camera.model = model;
    camera.fixed = i < bundle.first_local || i == 0;
    bundle.problem.cameras.push_back(camera);
    bundle.T_cw_expected.push_back(pose_at(T_out, i));
  }
  for (std::size_t i = 0; i < X.rows(); ++i) {
    bundle.problem.points.emplace_back(X.at(i, 0), X.at(i, 1), X.at(i, 2));
    bundle.points_expected.emplace_back(X_out.at(i, 0), X_out.at(i, 1), X_out.at(i, 2));
  }
  for (std::size_t i = 0; i < obs_kf.rows(); ++i) {
    BundleProblem::Observation o;
    o.camera = static_cast<std::uint32_t>(obs_kf.at(i));
    o.point = static_cast<std::uint32_t>(obs_pt.at(i));
    o.u = uvr.at(i, 0);
    o.v = uvr.at(i, 1);
    o.right_u = uvr.at(i, 2);
    o.has_depth = o.right_u >= 0;
    o.inverse_sigma2 = scales.inverse_sigma2(octave.at(i));
    bundle.problem.observations.push_back(o);
  }
  bundle.erased_expected = golden<std::uint8_t>(set, "out_obs_erased").values;
  return bundle;
}

}  // namespace orbslam::testing
