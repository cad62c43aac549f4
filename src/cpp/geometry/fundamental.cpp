// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/fundamental.hpp"

#include <limits>
#include <vector>

#include "geometry/model_scoring.hpp"
#include "geometry/small_solvers.hpp"

namespace orbslam {
namespace {

// Limit: chi-square, 1 degree of freedom, 95 %; credit: that of a homography's directions.
constexpr ErrorGate epipolar_gate{3.841, 5.991};

/// Squared distances of the points (target_u, target_v) from the lines F (u, v).
void line_errors(const Eigen::Matrix3d& F, const Eigen::ArrayXd& u, const Eigen::ArrayXd& v,
                 const Eigen::ArrayXd& target_u, const Eigen::ArrayXd& target_v,
                 Eigen::ArrayXd& errors) {
  errors.resize(u.size());
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    const double a = F(0, 0) * u[i] + F(0, 1) * v[i] + F(0, 2);
    const double b = F(1, 0) * u[i] + F(1, 1) * v[i] + F(1, 2);
    const double c = F(2, 0) * u[i] + F(2, 1) * v[i] + F(2, 2);
    const double residual = a * target_u[i] + b * target_v[i] + c;
    errors[i] = residual * residual / (a * a + b * b);
  }
}

/// Squared distances [raw pixels] of the targets from the planes, or lines, F h.
void line_errors(const Eigen::Matrix3d& F, const std::vector<HomogeneousPoint>& points,
                 const std::vector<HomogeneousPoint>& targets, Eigen::ArrayXd& errors) {
  errors.resize(static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d n = F * points[i].h;
    const double residual = n.dot(targets[i].h);
    errors[static_cast<Eigen::Index>(i)] =
        residual * residual / (targets[i].by_pixel.transpose() * n).squaredNorm();
  }
}

Eigen::Matrix3d nearest_of_rank_2(const Eigen::Matrix3d& matrix) {
  const Svd3 svd = svd_3(matrix);
  const Eigen::Vector3d& d = svd.values;
  return svd.U * Eigen::Vector3d(d[0], d[1], 0).asDiagonal() * svd.V.transpose();
}

/// The same from unit rays, which need no normalisation.
Eigen::Matrix3d fit_to_rays(const PointPairs& pairs, const EightPairs& sample) {
  Eigen::Matrix<double, 9, 8> A;
  for (std::size_t k = 0; k < sample.size(); ++k) {
    const auto i = static_cast<std::size_t>(sample[k]);
    const Eigen::Vector3d &h_1 = pairs.points_1[i].h, &h_2 = pairs.points_2[i].h;
    A.col(static_cast<Eigen::Index>(k)) << h_2.x() * h_1, h_2.y() * h_1, h_2.z() * h_1;
  }
  if (!A.allFinite()) return Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());
  const Eigen::Matrix<double, 9, 1> f = orthogonal_to_columns(A);
  return nearest_of_rank_2(
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(f.data()));
}

}  // namespace

Eigen::Matrix3d fit_fundamental(const PointPairs& pairs, const EightPairs& sample,
                                const Normalization& normalization_1,
                                const Normalization& normalization_2) {
  if (!pairs.flat) return fit_to_rays(pairs, sample);
  using Column = Eigen::Matrix<double, 9, 1>;
  Eigen::Matrix<double, 9, 8> A;  // transposed: an equation per column
  for (std::size_t k = 0; k < sample.size(); ++k) {
    const Eigen::Index i = sample[k];
    const double u_1 = normalization_1.u(pairs.u_1[i]), v_1 = normalization_1.v(pairs.v_1[i]);
    const double u_2 = normalization_2.u(pairs.u_2[i]), v_2 = normalization_2.v(pairs.v_2[i]);
    A.col(static_cast<Eigen::Index>(k)) =
        (Column() << u_2 * u_1, u_2 * v_1, u_2, v_2 * u_1, v_2 * v_1, v_2, u_1, v_1, 1).finished();
  }
  // Eight equations leave one direction of R^9.
  const Column f = orthogonal_to_columns(A);
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> F_normalized(f.data());
  return normalization_2.matrix().transpose() * nearest_of_rank_2(F_normalized) *
         normalization_1.matrix();
}

ScoredModel best_fundamental(const PointPairs& pairs, const std::vector<EightPairs>& samples,
                             const Normalization& normalization_1,
                             const Normalization& normalization_2, double sigma) {
  const auto fit = [&](const EightPairs& sample) {
    return fit_fundamental(pairs, sample, normalization_1, normalization_2);
  };
  const auto measure = [&](const Eigen::Matrix3d& F_21, PairErrors& errors) {
    if (!pairs.points_1.empty()) {
      line_errors(F_21.transpose(), pairs.points_2, pairs.points_1, errors.in_1);
      line_errors(F_21, pairs.points_1, pairs.points_2, errors.in_2);
      return;
    }
    line_errors(F_21.transpose(), pairs.u_2, pairs.v_2, pairs.u_1, pairs.v_1, errors.in_1);
    line_errors(F_21, pairs.u_1, pairs.v_1, pairs.u_2, pairs.v_2, errors.in_2);
  };
  return best_model(samples, sigma, epipolar_gate, fit, measure);
}

}  // namespace orbslam
