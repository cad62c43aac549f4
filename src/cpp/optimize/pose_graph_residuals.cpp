// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/pose_graph_residuals.hpp"

#include <cmath>

#include "optimize/rotation_jacobian.hpp"

namespace orbslam {
namespace {

/// A linear map of tangent vectors (omega, upsilon, sigma) of the kind adjoints and Jacobians of
/// similarities are: [A, 0, 0; B, D, e; 0, 0, 1]. Products of the blocks take a third of the time.
struct TangentMap {
  Eigen::Matrix3d A, B, D;
  Eigen::Vector3d e;

  explicit TangentMap(const Matrix7d& m)
      : A(m.topLeftCorner<3, 3>()),
        B(m.block<3, 3>(3, 0)),
        D(m.block<3, 3>(3, 3)),
        e(m.block<3, 1>(3, 6)) {}

  /// Multiplies this map by Ad(S).
  void multiply_by_adjoint(const Similarity& S) {
    const Eigen::Matrix3d R = S.rotation_matrix();
    const Eigen::Vector3d& t = S.translation();
    B = (B + D * skew(t)) * R;
    A = A * R;
    e -= D * t;
    D = (S.scale() * D * R).eval();
  }

  /// Multiplies this map by that from the view's parameters to its left tangent, [J, 0, 0; 0, Q, 0;
  /// 0, 0, 1] with the left Jacobian J and the rotation Q.
  void multiply_by_chart(const PoseGraphView& view) {
    A = A * view.left_jacobian();
    B = B * view.left_jacobian();
    D = D * view.turn();
  }
};

template <int kParameters>
void write(const TangentMap& map, const PoseGraphView& view, double sign, double* out) {
  Eigen::Map<Eigen::Matrix<double, 7, kParameters, Eigen::RowMajor>> J(out);
  J.setZero();
  if constexpr (kParameters == 4) {
    J.template block<3, 1>(0, 0) = sign * map.A * view.up();
    J.template block<3, 1>(3, 0) = sign * map.B * view.up();
    J.template block<3, 3>(3, 1) = sign * map.D;
    return;
  }
  J.template block<3, 3>(0, 0) = sign * map.A;
  J.template block<3, 3>(3, 0) = sign * map.B;
  J.template block<3, 3>(3, 3) = sign * map.D;
  if constexpr (kParameters == 7) {
    J.template block<3, 1>(3, 6) = sign * map.e;
    J(6, 6) = sign;
  }
}

}  // namespace

void PoseGraphView::move(const double* parameters, int n_parameters) {
  const bool upright = n_parameters == 4;
  const Eigen::Vector3d w = upright
                                ? parameters[0] * up_
                                : Eigen::Vector3d(Eigen::Map<const Eigen::Vector3d>(parameters));
  const Eigen::Map<const Eigen::Vector3d> v(parameters + (upright ? 1 : 3));
  const double log_scale = n_parameters == 7 ? parameters[6] : 0.0;
  valid_ = w.allFinite() && v.allFinite() && std::abs(log_scale) < kMaxLogScale;
  if (!valid_) return;
  Vector6d rotation = Vector6d::Zero();
  rotation.head<3>() = w;
  const Eigen::Quaterniond q = Pose::exp(rotation).rotation();
  const double growth = std::exp(log_scale);
  left_jacobian_ = rotation_left_jacobian(w);
  turn_ = growth * q.toRotationMatrix();
  S_iw_ = Similarity(growth * start_.scale(), q * start_.rotation(),
                     turn_ * (start_.translation() + v));
}

Vector7d pose_graph_residual(const Similarity& S_ji, const Similarity& S_iw,
                             const Similarity& S_jw) {
  return (S_ji * S_iw * S_jw.inverse()).log();
}

template <int kParameters>
bool PoseGraphResidual<kParameters>::Evaluate(double const* const*, double* residuals,
                                              double** jacobians) const {
  if (!view_i_->valid() || !view_j_->valid()) return false;
  const Vector7d r = pose_graph_residual(S_ji_, view_i_->S_iw(), view_j_->S_iw());
  if (!r.allFinite()) return false;
  Eigen::Map<Vector7d>{residuals} = r;
  if (jacobians == nullptr) return true;

  // A left perturbation d of S_iw is Ad(S_ji) d on the left of the product, one of S_jw is -d on
  // its right. The inverse right Jacobian is x / (1 - exp(-x)) = x / (exp(x) - 1) + x at x = ad(r).
  const Matrix7d left = similarity_left_jacobian_inverse(r);
  if (jacobians[0] != nullptr) {
    TangentMap map(left);
    map.multiply_by_adjoint(S_ji_);
    map.multiply_by_chart(*view_i_);
    write<kParameters>(map, *view_i_, 1, jacobians[0]);
  }
  if (jacobians[1] != nullptr) {
    TangentMap map(left + similarity_ad(r));
    map.multiply_by_chart(*view_j_);
    write<kParameters>(map, *view_j_, -1, jacobians[1]);
  }
  return true;
}

template class PoseGraphResidual<4>;
template class PoseGraphResidual<6>;
template class PoseGraphResidual<7>;

}  // namespace orbslam
