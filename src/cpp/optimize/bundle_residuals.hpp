// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/sized_cost_function.h>

#include <type_traits>

#include "base/pose.hpp"
#include "camera/camera.hpp"

namespace orbslam {

/// A camera of a bundle in a chart around its starting pose: six parameters (w, v) stand for
/// T_cw = (exp(w) R, exp(w) t + v) with (R, t) the pose at the start. To first order that is the
/// left perturbation (rotation, translation) of the camera, and being a plain vector space it saves
/// Ceres a product by a manifold's Jacobian per observation. See
/// docs/method/adjustment.md#residuals.
class BundleView {
 public:
  static constexpr int kParameters = 6;

  /// `camera` must outlive the view.
  BundleView(const Pose& T_cw, const Camera& camera);
  /// Moves to the given parameters.
  void move(const double* parameters);

  Pose T_cw() const { return Pose(rotation_, t_cw_); }
  const Eigen::Matrix3d& R_cw() const { return R_cw_; }
  const Eigen::Vector3d& t_cw() const { return t_cw_; }
  const Eigen::Vector3d& shift() const { return shift_; }  ///< v
  /// Left Jacobian of SO(3) at w: exp(w + d) = exp(left_jacobian * d) exp(w) to first order.
  const Eigen::Matrix3d& left_jacobian() const { return left_jacobian_; }
  const Camera& camera() const { return *camera_; }

 private:
  Pose start_;
  const Camera* camera_;
  Eigen::Quaterniond rotation_;
  Eigen::Matrix3d R_cw_, left_jacobian_;
  Eigen::Vector3d t_cw_, shift_;
};

/// One observation, and its state at the present evaluation point. The state is computed once per
/// point (evaluate) and read by all cost functions of the observation.
struct BundleMeasurement {
  const BundleView* view = nullptr;
  const double* point = nullptr;  ///< world
  /// Of the point by its parameters; nullptr: they are its coordinates.
  const Eigen::Matrix3d* chart = nullptr;
  double u = 0, right_u = 0;        ///< read with depth alone
  Sight sight = Sight::Identity();  ///< of the keypoint
  double scale = 1;        ///< one over the standard deviation; 0 takes the observation out
  double right_scale = 1;  ///< that of the right column over that of u and v
  double huber = 0;        ///< width of the kernel; 0: none
  bool has_depth = false;

  double p_c[3] = {};  ///< the point in the camera frame
  double inverse_q = 0;
  double predicted[2] = {};  ///< raw pixel of the point, less that of the keypoint
  double factor = 0;         ///< scale times sqrt(rho'), of residuals and derivatives
  double residual[3] = {};   ///< u, v, right u: measurement minus prediction, times factor

  /// Returns rho(q) - rho'(q) q: the robustified cost minus the weighted squared residuals. Points
  /// that the sight cannot compare have zero residuals.
  double evaluate();
  /// Adds this observation's part of the diagonal of the Gauss-Newton matrix.
  void add_curvature(Vector6d& pose_diagonal, Eigen::Vector3d& point_diagonal) const;
};

/// Two residuals of an observation. kFree: the parameter blocks are camera and point, otherwise the
/// camera is fixed and the only block is the point. Ceres' Schur complement is specialised for rows
/// of two (and cameras of six), so three rows are cut into two blocks. Kernels are part of the
/// residuals: no loss function must be attached.
template <bool kFree>
using TwoResiduals =
    std::conditional_t<kFree, ceres::SizedCostFunction<2, BundleView::kParameters, 3>,
                       ceres::SizedCostFunction<2, 3>>;

/// Rows u and v.
template <bool kFree>
class ImageResiduals final : public TwoResiduals<kFree> {
 public:
  explicit ImageResiduals(const BundleMeasurement* measurement) : measurement_(measurement) {}
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  const BundleMeasurement* measurement_;
};

/// The row of the right column, and an empty one.
template <bool kFree>
class RightResidual final : public TwoResiduals<kFree> {
 public:
  explicit RightResidual(const BundleMeasurement* measurement) : measurement_(measurement) {}
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  const BundleMeasurement* measurement_;
};

/// Adds the part of the robustified cost that is missing in the weighted residuals. The total cost,
/// its gradient and the Gauss-Newton matrix are then those of ceres::HuberLoss on each observation.
/// One per problem, on any point: it has no derivatives.
class MissingCost final : public ceres::SizedCostFunction<2, 3> {
 public:
  /// `sum` is that of BundleMeasurement::evaluate() over the problem.
  explicit MissingCost(const double* sum) : sum_(sum) {}
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  const double* sum_;
};

}  // namespace orbslam
