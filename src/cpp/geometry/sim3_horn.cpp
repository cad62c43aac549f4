// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/sim3_horn.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "geometry/small_solvers.hpp"

namespace orbslam {
namespace {

// A set whose width is below this fraction of its length does not determine the rotation about its
// line.
constexpr double kMinExtentRatio = 1e-6;

/// Extents are measured along and across the line through the mean and the farthest point: the
/// smaller eigenvalues of the scatter matrix would drown in rounding at such ratios.
bool collinear(const Eigen::Ref<const Eigen::Matrix3Xd>& points, const Eigen::Vector3d& mean) {
  double along = 0;
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Eigen::Vector3d q = points.col(i) - mean;
    if (q.norm() <= along) continue;
    along = q.norm();
    axis = q / along;
  }
  double across = 0;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    across = std::max(across, axis.cross(points.col(i) - mean).norm());
  }
  return !(across > kMinExtentRatio * along);
}

/// Horn's matrix: its eigenvector of the largest eigenvalue is the quaternion (w, x, y, z) that
/// turns set 2 onto set 1. `m` is the sum of q_2 q_1^T.
Eigen::Matrix4d quaternion_matrix(const Eigen::Matrix3d& m) {
  Eigen::Matrix4d n;
  const Eigen::Vector3d axis(m(1, 2) - m(2, 1), m(2, 0) - m(0, 2), m(0, 1) - m(1, 0));
  n(0, 0) = m.trace();
  n.topRightCorner<1, 3>() = axis.transpose();
  n.bottomLeftCorner<3, 1>() = axis;
  n.bottomRightCorner<3, 3>() = m + m.transpose() - m.trace() * Eigen::Matrix3d::Identity();
  return n;
}

}  // namespace

std::optional<Similarity> align_similarity(const Eigen::Ref<const Eigen::Matrix3Xd>& points_1,
                                           const Eigen::Ref<const Eigen::Matrix3Xd>& points_2,
                                           bool fix_scale) {
  const Eigen::Index n = points_1.cols();
  if (n < 3 || points_2.cols() != n) {
    throw std::invalid_argument("align_similarity: at least 3 points, as many in either set");
  }
  if (!points_1.allFinite() || !points_2.allFinite()) return std::nullopt;
  const Eigen::Vector3d mean_1 = points_1.rowwise().mean(), mean_2 = points_2.rowwise().mean();
  if (collinear(points_1, mean_1) || collinear(points_2, mean_2)) return std::nullopt;

  Eigen::Matrix3d m = Eigen::Matrix3d::Zero();
  for (Eigen::Index i = 0; i < n; ++i) {
    m += (points_2.col(i) - mean_2) * (points_1.col(i) - mean_1).transpose();
  }
  if (!m.allFinite()) return std::nullopt;
  const Eigen::Vector4d q = symmetric_eigenvectors_4(quaternion_matrix(m)).col(3);
  const Eigen::Quaterniond rotation = Eigen::Quaterniond(q(0), q(1), q(2), q(3)).normalized();

  double scale = 1;
  if (!fix_scale) {
    double product = 0, square = 0;
    for (Eigen::Index i = 0; i < n; ++i) {
      const Eigen::Vector3d q_2 = points_2.col(i) - mean_2;
      product += (points_1.col(i) - mean_1).dot(rotation * q_2);
      square += q_2.squaredNorm();
    }
    scale = product / square;
    if (!(scale > 0) || !std::isfinite(scale)) return std::nullopt;
  }
  return Similarity(scale, rotation, mean_1 - scale * (rotation * mean_2));
}

}  // namespace orbslam
