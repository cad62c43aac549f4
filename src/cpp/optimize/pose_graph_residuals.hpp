// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/sized_cost_function.h>

#include "base/similarity.hpp"

namespace orbslam {

/// Scales are kept between exp(-kMaxLogScale) and exp(kMaxLogScale): farther than any step that
/// could be accepted, and products of a few stay in the range of doubles.
inline constexpr double kMaxLogScale = 100;

/// A vertex of a pose graph in a chart around its start: seven parameters (w, v, c) stand for
/// S_iw = (exp(c) s, exp(w) R, exp(c) exp(w) (t + v)) with (s, R, t) the start. The camera turns
/// and rescales about its own centre, and the centre moves by -R^T v / s whatever its turn and
/// scale. To first order that is the left perturbation (rotation, translation, logarithm of the
/// scale). After a large drift of scale or rotation, steps that do not move the centres need half
/// the iterations of those that do. The chart is a plain vector space, which saves Ceres a product
/// with a manifold's Jacobian per edge. Without the last parameter the scale is fixed. Four
/// parameters (a, v) stand for w = a R e_z: a camera turns about the third axis of the world. See
/// docs/method/adjustment.md#pose-graph.
class PoseGraphView {
 public:
  explicit PoseGraphView(const Similarity& S_iw)
      : start_(S_iw), S_iw_(S_iw), up_(S_iw.rotation() * Eigen::Vector3d::UnitZ()) {}

  /// Moves to the given four, six or seven parameters, unless they are not finite or the logarithm
  /// of the scale is too large. Then the view is invalid and does not move.
  void move(const double* parameters, int n_parameters);
  bool valid() const { return valid_; }

  const Similarity& S_iw() const { return S_iw_; }
  const Eigen::Matrix3d& turn() const { return turn_; }  ///< exp(c) exp(w)
  const Eigen::Vector3d& up() const { return up_; }      ///< third axis of the world, R e_z
  /// Left Jacobian of SO(3) at w: exp(w + d) = exp(left_jacobian * d) exp(w) to first order.
  const Eigen::Matrix3d& left_jacobian() const { return left_jacobian_; }

 private:
  Similarity start_, S_iw_;
  Eigen::Vector3d up_;
  Eigen::Matrix3d turn_ = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d left_jacobian_ = Eigen::Matrix3d::Identity();
  bool valid_ = true;
};

/// log(S_ji S_iw S_jw^-1): zero where the vertices agree with the measured S_ji.
Vector7d pose_graph_residual(const Similarity& S_ji, const Similarity& S_iw,
                             const Similarity& S_jw);

/// The residual of an edge; its blocks are the parameters of view i and of view j, kParameters of
/// each: 7, 6 with scales kept, or 4 with roll and pitch kept as well. The views must have moved to
/// them before.
template <int kParameters>
class PoseGraphResidual final : public ceres::SizedCostFunction<7, kParameters, kParameters> {
 public:
  PoseGraphResidual(const Similarity& S_ji, const PoseGraphView* view_i,
                    const PoseGraphView* view_j)
      : S_ji_(S_ji), view_i_(view_i), view_j_(view_j) {}
  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  Similarity S_ji_;
  const PoseGraphView* view_i_;
  const PoseGraphView* view_j_;
};

}  // namespace orbslam
