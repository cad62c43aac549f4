// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/sized_cost_function.h>

#include <type_traits>

#include "base/pose.hpp"
#include "camera/camera.hpp"
#include "optimize/pose_manifold.hpp"

namespace orbslam {

/// A camera at the present evaluation point. The rotation matrix is computed once per evaluation,
/// not once per observation.
struct BundleView {
  Eigen::Matrix3d R_cw = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t_cw = Eigen::Vector3d::Zero();
  Pinhole pinhole;
  double bf = 0;

  void set_pose(const Pose& T_cw) {
    R_cw = T_cw.rotation_matrix();
    t_cw = T_cw.translation();
  }
};

/// What one observation measured.
struct BundleMeasurement {
  const BundleView* view = nullptr;
  double u = 0, v = 0, right_u = 0;
  double scale = 1;  ///< one over the standard deviation; 0 takes the observation out
  double huber = 0;  ///< width of the kernel; 0: none
  bool has_depth = false;
};

/// Two residuals of an observation by one camera, measurement minus prediction, times `scale`.
/// Points on the camera's plane have zero residuals. kFree: parameter blocks pose and point,
/// otherwise the camera is fixed and the only block is the point.
template <bool kFree>
using TwoResiduals =
    std::conditional_t<kFree, ceres::SizedCostFunction<2, PoseManifold::kAmbientSize, 3>,
                       ceres::SizedCostFunction<2, 3>>;

/// Monocular: u and v. The kernel, if any, is a loss function of the problem.
template <bool kFree>
class MonoResiduals final : public TwoResiduals<kFree> {
 public:
  explicit MonoResiduals(const BundleMeasurement* measurement) : measurement_(measurement) {}
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  const BundleMeasurement* measurement_;
};

/// Stereo: three residuals under one common Huber kernel, cut into two cost functions of two rows
/// because Ceres' Schur complement is specialised for rows of two. kSecond false: u and v; true:
/// right u, and a row without derivatives that carries the part of the robustified cost which
/// sqrt(rho') times the residuals lacks. Cost, gradient and Gauss-Newton matrix of the pair are
/// those of a three-row block under ceres::HuberLoss. No loss function must be attached.
template <bool kFree, bool kSecond>
class StereoResiduals final : public TwoResiduals<kFree> {
 public:
  explicit StereoResiduals(const BundleMeasurement* measurement) : measurement_(measurement) {}
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  const BundleMeasurement* measurement_;
};

/// Adds the observation's part of the diagonal of the Gauss-Newton matrix (kernel weight included).
void add_curvature(const BundleMeasurement& measurement, const Eigen::Vector3d& point,
                   Vector6d& pose_diagonal, Eigen::Vector3d& point_diagonal);

}  // namespace orbslam
