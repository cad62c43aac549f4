// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/bundle_residuals.hpp"

#include <algorithm>
#include <cmath>

namespace orbslam {
namespace {

constexpr double kTinyDepth = 1e-9;

/// An observed point in the camera frame and on the normalised image plane.
struct Projected {
  double p[3];  // camera frame
  double x, y, inverse_z;
  double scale;  // 0 where there is no projection

  Projected(const BundleMeasurement& m, const double* w) {
    const Eigen::Matrix3d& R = m.view->R_cw;
    const Eigen::Vector3d& t = m.view->t_cw;
    for (int i = 0; i < 3; ++i) p[i] = R(i, 0) * w[0] + R(i, 1) * w[1] + R(i, 2) * w[2] + t(i);
    const bool projects = std::abs(p[2]) > kTinyDepth;
    inverse_z = projects ? 1.0 / p[2] : 0.0;
    scale = projects ? m.scale : 0.0;
    x = p[0] * inverse_z;
    y = p[1] * inverse_z;
  }

  double error_u(const BundleMeasurement& m) const {
    return scale * (m.u - (m.view->pinhole.fx * x + m.view->pinhole.cx));
  }
  double error_v(const BundleMeasurement& m) const {
    return scale * (m.v - (m.view->pinhole.fy * y + m.view->pinhole.cy));
  }
  double error_right_u(const BundleMeasurement& m) const {
    return scale *
           (m.right_u - (m.view->pinhole.fx * x + m.view->pinhole.cx - m.view->bf * inverse_z));
  }
};

/// Writes one row of the Jacobians. (a, b, c) is the derivative of the *prediction* with respect to
/// the point in the camera frame; a pointer may be null.
template <bool kFree>
void write_row(const BundleMeasurement& m, const Projected& projected, int row, double a, double b,
               double c, double** jacobians) {
  if constexpr (kFree) {
    if (jacobians[0] != nullptr) {
      double* out = jacobians[0] + row * PoseManifold::kAmbientSize;
      const double* p = projected.p;
      out[0] = b * p[2] - c * p[1];
      out[1] = c * p[0] - a * p[2];
      out[2] = a * p[1] - b * p[0];
      out[3] = -a;
      out[4] = -b;
      out[5] = -c;
      out[6] = 0;
    }
  }
  constexpr int kPointBlock = kFree ? 1 : 0;
  if (jacobians[kPointBlock] != nullptr) {
    double* out = jacobians[kPointBlock] + row * 3;
    const Eigen::Matrix3d& R = m.view->R_cw;
    for (int i = 0; i < 3; ++i) out[i] = -(a * R(0, i) + b * R(1, i) + c * R(2, i));
  }
}

/// Rows u and v, times `factor`.
template <bool kFree>
void write_image_rows(const BundleMeasurement& m, const Projected& projected, double factor,
                      double** jacobians) {
  const double a = factor * projected.scale * m.view->pinhole.fx * projected.inverse_z;
  const double b = factor * projected.scale * m.view->pinhole.fy * projected.inverse_z;
  write_row<kFree>(m, projected, 0, a, 0, -a * projected.x, jacobians);
  write_row<kFree>(m, projected, 1, 0, b, -b * projected.y, jacobians);
}

/// The row of the right column, times `factor`.
template <bool kFree>
void write_right_row(const BundleMeasurement& m, const Projected& projected, int row, double factor,
                     double** jacobians) {
  const double scale = factor * projected.scale * projected.inverse_z;
  const double a = scale * m.view->pinhole.fx;
  const double c = -a * projected.x + scale * m.view->bf * projected.inverse_z;
  write_row<kFree>(m, projected, row, a, 0, c, jacobians);
}

}  // namespace

template <bool kFree>
bool MonoResiduals<kFree>::Evaluate(double const* const* parameters, double* residuals,
                                    double** jacobians) const {
  const BundleMeasurement& m = *measurement_;
  const Projected projected(m, parameters[kFree ? 1 : 0]);
  residuals[0] = projected.error_u(m);
  residuals[1] = projected.error_v(m);
  if (jacobians != nullptr) write_image_rows<kFree>(m, projected, 1.0, jacobians);
  return true;
}

template <bool kFree, bool kSecond>
bool StereoResiduals<kFree, kSecond>::Evaluate(double const* const* parameters, double* residuals,
                                               double** jacobians) const {
  const BundleMeasurement& m = *measurement_;
  const Projected projected(m, parameters[kFree ? 1 : 0]);
  const double u = projected.error_u(m), v = projected.error_v(m);
  const double right_u = projected.error_right_u(m);

  double factor = 1, missing_cost = 0;
  if (m.huber > 0) {
    const double q = u * u + v * v + right_u * right_u;
    if (q > m.huber * m.huber) {
      const double root = std::sqrt(q);
      factor = std::sqrt(m.huber / root);
      // rho(q) - rho'(q) q = (2 d root - d^2) - d root
      missing_cost = m.huber * (root - m.huber);
    }
  }
  if constexpr (kSecond) {
    residuals[0] = factor * right_u;
    residuals[1] = std::sqrt(std::max(0.0, missing_cost));
  } else {
    residuals[0] = factor * u;
    residuals[1] = factor * v;
  }
  if (jacobians == nullptr) return true;
  if constexpr (kSecond) {
    write_right_row<kFree>(m, projected, 0, factor, jacobians);
    write_row<kFree>(m, projected, 1, 0, 0, 0, jacobians);
  } else {
    write_image_rows<kFree>(m, projected, factor, jacobians);
  }
  return true;
}

void add_curvature(const BundleMeasurement& m, const Eigen::Vector3d& point,
                   Vector6d& pose_diagonal, Eigen::Vector3d& point_diagonal) {
  const Projected projected(m, point.data());
  Eigen::Matrix<double, 3, PoseManifold::kAmbientSize, Eigen::RowMajor> pose;
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> position;
  double* jacobians[] = {pose.data(), position.data()};
  write_image_rows<true>(m, projected, 1.0, jacobians);
  double q = std::pow(projected.error_u(m), 2) + std::pow(projected.error_v(m), 2);
  if (m.has_depth) {
    write_right_row<true>(m, projected, 2, 1.0, jacobians);
    q += std::pow(projected.error_right_u(m), 2);
  } else {
    pose.row(2).setZero();
    position.row(2).setZero();
  }
  const double weight = m.huber > 0 && q > m.huber * m.huber ? m.huber / std::sqrt(q) : 1.0;
  pose_diagonal += weight * pose.leftCols<6>().colwise().squaredNorm().transpose();
  point_diagonal += weight * position.colwise().squaredNorm().transpose();
}

template class MonoResiduals<true>;
template class MonoResiduals<false>;
template class StereoResiduals<true, true>;
template class StereoResiduals<true, false>;
template class StereoResiduals<false, true>;
template class StereoResiduals<false, false>;

}  // namespace orbslam
