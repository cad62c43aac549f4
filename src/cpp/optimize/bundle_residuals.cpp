// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/bundle_residuals.hpp"

#include <algorithm>
#include <cmath>

#include "optimize/rotation_jacobian.hpp"

namespace orbslam {
namespace {

constexpr double kTinyDepth = 1e-9;

/// Derivative of one weighted prediction with respect to the point in the camera frame.
struct CameraRow {
  double a, b, c;
};

/// Of the prediction of the raw pixel: (B.row(row) p) / (B.row(2) p).
CameraRow pixel_row(const BundleMeasurement& m, int row) {
  const double scale = m.factor * m.inverse_q;
  const double at = m.predicted[row];
  const auto entry = [&](int k) { return scale * (m.sight(row, k) - at * m.sight(2, k)); };
  return {entry(0), entry(1), entry(2)};
}
CameraRow row_u(const BundleMeasurement& m) { return pixel_row(m, 0); }
CameraRow row_v(const BundleMeasurement& m) { return pixel_row(m, 1); }
CameraRow row_right(const BundleMeasurement& m) {
  const CameraRow row = row_u(m);
  const double by_q = m.factor * m.view->camera().bf() * m.inverse_q * m.inverse_q;
  return {m.right_scale * (row.a + by_q * m.sight(2, 0)),
          m.right_scale * (row.b + by_q * m.sight(2, 1)),
          m.right_scale * (row.c + by_q * m.sight(2, 2))};
}

/// Derivative of the residual (minus the prediction) with respect to the six camera parameters.
void write_camera_row(const BundleMeasurement& m, const CameraRow& g, double* out) {
  const Eigen::Matrix3d& J = m.view->left_jacobian();
  const Eigen::Vector3d& v = m.view->shift();
  // p_c = exp(w) y + v, so d p_c / d w = -[p_c - v]x left_jacobian.
  const double y0 = m.p_c[0] - v(0), y1 = m.p_c[1] - v(1), y2 = m.p_c[2] - v(2);
  const double r0 = g.b * y2 - g.c * y1;
  const double r1 = g.c * y0 - g.a * y2;
  const double r2 = g.a * y1 - g.b * y0;
  for (int i = 0; i < 3; ++i) out[i] = r0 * J(0, i) + r1 * J(1, i) + r2 * J(2, i);
  out[3] = -g.a;
  out[4] = -g.b;
  out[5] = -g.c;
}

void write_point_row(const BundleMeasurement& m, const CameraRow& g, double* out) {
  const Eigen::Matrix3d& R = m.view->R_cw();
  for (int i = 0; i < 3; ++i) out[i] = -(g.a * R(0, i) + g.b * R(1, i) + g.c * R(2, i));
  if (m.chart == nullptr) return;
  const Eigen::Matrix3d& C = *m.chart;
  const double x = out[0], y = out[1], z = out[2];
  for (int i = 0; i < 3; ++i) out[i] = x * C(0, i) + y * C(1, i) + z * C(2, i);
}

template <bool kFree>
void write_rows(const BundleMeasurement& m, const CameraRow& first, const CameraRow& second,
                double** jacobians) {
  if constexpr (kFree) {
    if (jacobians[0] != nullptr) {
      write_camera_row(m, first, jacobians[0]);
      write_camera_row(m, second, jacobians[0] + BundleView::kParameters);
    }
  }
  double* point = jacobians[kFree ? 1 : 0];
  if (point != nullptr) {
    write_point_row(m, first, point);
    write_point_row(m, second, point + 3);
  }
}

}  // namespace

BundleView::BundleView(const Pose& T_cw, const Camera& camera) : start_(T_cw), camera_(&camera) {
  const double origin[kParameters] = {};
  move(origin);
}

void BundleView::move(const double* parameters) {
  const Eigen::Map<const Eigen::Vector3d> w(parameters);
  shift_ = Eigen::Map<const Eigen::Vector3d>(parameters + 3);
  left_jacobian_ = rotation_left_jacobian(w);
  Vector6d xi = Vector6d::Zero();
  xi.head<3>() = w;
  const Eigen::Quaterniond turn = Pose::exp(xi).rotation();
  rotation_ = (turn * start_.rotation()).normalized();
  R_cw_ = rotation_.toRotationMatrix();
  t_cw_ = turn * start_.translation() + shift_;
}

double BundleMeasurement::evaluate() {
  const Eigen::Matrix3d& R = view->R_cw();
  const Eigen::Vector3d& t = view->t_cw();
  for (int i = 0; i < 3; ++i) {
    p_c[i] = R(i, 0) * point[0] + R(i, 1) * point[1] + R(i, 2) * point[2] + t(i);
  }
  const double q = sight(2, 0) * p_c[0] + sight(2, 1) * p_c[1] + sight(2, 2) * p_c[2] + sight(2, 3);
  const bool usable = scale > 0 && std::abs(q) > kTinyDepth;
  if (!usable) {  // also when the point is NaN
    std::fill_n(p_c, 3, 0.0);
    p_c[2] = 1;
    std::fill_n(residual, 3, 0.0);
    std::fill_n(predicted, 2, 0.0);
    inverse_q = factor = 0;
    return 0;
  }
  inverse_q = 1 / q;
  factor = scale;
  for (int row = 0; row < 2; ++row) {
    predicted[row] =
        (sight(row, 0) * p_c[0] + sight(row, 1) * p_c[1] + sight(row, 2) * p_c[2] + sight(row, 3)) *
        inverse_q;
    residual[row] = -factor * predicted[row];
  }
  const double disparity_error = view->camera().bf() * inverse_q - (u - right_u);
  residual[2] = has_depth ? right_scale * (factor * (disparity_error - predicted[0])) : 0.0;
  if (huber == 0) return 0;
  const double square =
      residual[0] * residual[0] + residual[1] * residual[1] + residual[2] * residual[2];
  if (square <= huber * huber) return 0;
  const double root = std::sqrt(square);
  const double weight = std::sqrt(huber / root);
  factor *= weight;
  for (double& r : residual) r *= weight;
  return huber * (root - huber);  // (2 d root - d^2) - d root
}

void BundleMeasurement::add_curvature(Vector6d& pose_diagonal,
                                      Eigen::Vector3d& point_diagonal) const {
  const CameraRow rows[] = {row_u(*this), row_v(*this), row_right(*this)};
  for (int i = 0; i < (has_depth ? 3 : 2); ++i) {
    Vector6d pose;
    Eigen::Vector3d position;
    write_camera_row(*this, rows[i], pose.data());
    write_point_row(*this, rows[i], position.data());
    pose_diagonal += pose.cwiseAbs2();
    point_diagonal += position.cwiseAbs2();
  }
}

template <bool kFree>
bool ImageResiduals<kFree>::Evaluate(double const* const*, double* residuals,
                                     double** jacobians) const {
  const BundleMeasurement& m = *measurement_;
  residuals[0] = m.residual[0];
  residuals[1] = m.residual[1];
  if (jacobians != nullptr) write_rows<kFree>(m, row_u(m), row_v(m), jacobians);
  return true;
}

template <bool kFree>
bool RightResidual<kFree>::Evaluate(double const* const*, double* residuals,
                                    double** jacobians) const {
  const BundleMeasurement& m = *measurement_;
  residuals[0] = m.residual[2];
  residuals[1] = 0;
  if (jacobians != nullptr) write_rows<kFree>(m, row_right(m), {0, 0, 0}, jacobians);
  return true;
}

bool MissingCost::Evaluate(double const* const*, double* residuals, double** jacobians) const {
  residuals[0] = std::sqrt(std::max(0.0, *sum_));
  residuals[1] = 0;
  if (jacobians != nullptr && jacobians[0] != nullptr) std::fill_n(jacobians[0], 6, 0.0);
  return true;
}

template class ImageResiduals<true>;
template class ImageResiduals<false>;
template class RightResidual<true>;
template class RightResidual<false>;

}  // namespace orbslam
