// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/homography.hpp"

#include <Eigen/LU>
#include <limits>
#include <vector>

#include "geometry/model_scoring.hpp"
#include "geometry/small_solvers.hpp"

namespace orbslam {
namespace {

constexpr ErrorGate transfer_gate{5.991, 5.991};  // chi-square, 2 degrees of freedom, 95 %

/// Squared distances of H (u, v) from (target_u, target_v).
void transfer_errors(const Eigen::Matrix3d& H, const Eigen::ArrayXd& u, const Eigen::ArrayXd& v,
                     const Eigen::ArrayXd& target_u, const Eigen::ArrayXd& target_v,
                     Eigen::ArrayXd& errors) {
  errors.resize(u.size());
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    const double inverse_w = 1.0 / (H(2, 0) * u[i] + H(2, 1) * v[i] + H(2, 2));
    const double du = (H(0, 0) * u[i] + H(0, 1) * v[i] + H(0, 2)) * inverse_w - target_u[i];
    const double dv = (H(1, 0) * u[i] + H(1, 1) * v[i] + H(1, 2)) * inverse_w - target_v[i];
    errors[i] = du * du + dv * dv;
  }
}

/// Squared errors of H h against the targets.
void transfer_errors(const Eigen::Matrix3d& H, const std::vector<HomogeneousPoint>& points,
                     const std::vector<HomogeneousPoint>& targets, Eigen::ArrayXd& errors) {
  errors.resize(static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d q = targets[i].B * (H * points[i].h);
    errors[static_cast<Eigen::Index>(i)] = q.head<2>().squaredNorm() / (q.z() * q.z());
  }
}

/// The same from unit rays, which need no normalisation.
Eigen::Matrix3d fit_to_rays(const PointPairs& pairs, const EightPairs& sample) {
  Eigen::Matrix<double, 16, 9> A;
  for (std::size_t k = 0; k < sample.size(); ++k) {
    const auto i = static_cast<std::size_t>(sample[k]);
    const HomogeneousPoint& target = pairs.points_2[i];
    const Eigen::RowVector3d h = pairs.points_1[i].h.transpose();
    for (int row = 0; row < 2; ++row) {
      const Eigen::RowVector3d b = target.B.row(row).normalized();
      A.row(2 * static_cast<Eigen::Index>(k) + row) << b.x() * h, b.y() * h, b.z() * h;
    }
  }
  const Eigen::Matrix<double, 9, 9> normal = A.transpose() * A;
  if (!normal.allFinite()) {
    return Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());
  }
  const Eigen::Matrix<double, 9, 1> h = least_eigenvector<9>(normal);
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(h.data());
}

}  // namespace

Eigen::Matrix3d fit_homography(const PointPairs& pairs, const EightPairs& sample,
                               const Normalization& normalization_1,
                               const Normalization& normalization_2) {
  if (!pairs.flat) return fit_to_rays(pairs, sample);
  using Row = Eigen::Matrix<double, 1, 9>;
  Eigen::Matrix<double, 16, 9> A;
  for (std::size_t k = 0; k < sample.size(); ++k) {
    const Eigen::Index i = sample[k], row = 2 * static_cast<Eigen::Index>(k);
    const double u_1 = normalization_1.u(pairs.u_1[i]), v_1 = normalization_1.v(pairs.v_1[i]);
    const double u_2 = normalization_2.u(pairs.u_2[i]), v_2 = normalization_2.v(pairs.v_2[i]);
    A.row(row) = (Row() << 0, 0, 0, -u_1, -v_1, -1, v_2 * u_1, v_2 * v_1, v_2).finished();
    A.row(row + 1) = (Row() << u_1, v_1, 1, 0, 0, 0, -u_2 * u_1, -u_2 * v_1, -u_2).finished();
  }
  // The normal matrix costs a third of the SVD of A; in float64 it keeps more digits than the
  // pixels have.
  const Eigen::Matrix<double, 9, 9> normal = A.transpose() * A;
  const Eigen::Matrix<double, 9, 1> h = least_eigenvector<9>(normal);
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> H_normalized(h.data());
  return normalization_2.inverse() * H_normalized * normalization_1.matrix();
}

ScoredModel best_homography(const PointPairs& pairs, const std::vector<EightPairs>& samples,
                            const Normalization& normalization_1,
                            const Normalization& normalization_2, double sigma) {
  const auto fit = [&](const EightPairs& sample) {
    return fit_homography(pairs, sample, normalization_1, normalization_2);
  };
  const auto measure = [&](const Eigen::Matrix3d& H_21, PairErrors& errors) {
    if (!pairs.points_1.empty()) {
      transfer_errors(H_21.inverse(), pairs.points_2, pairs.points_1, errors.in_1);
      transfer_errors(H_21, pairs.points_1, pairs.points_2, errors.in_2);
      return;
    }
    transfer_errors(H_21.inverse(), pairs.u_2, pairs.v_2, pairs.u_1, pairs.v_1, errors.in_1);
    transfer_errors(H_21, pairs.u_1, pairs.v_1, pairs.u_2, pairs.v_2, errors.in_2);
  };
  return best_model(samples, sigma, transfer_gate, fit, measure);
}

}  // namespace orbslam
