// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/motion_hypotheses.hpp"

#include <Eigen/LU>
#include <array>
#include <cmath>

#include "geometry/small_solvers.hpp"

namespace orbslam {
namespace {

constexpr double min_singular_ratio = 1.00001;

struct SignPair {
  double first, third;
  /// Of the rotation's sine.
  double product() const { return first * third; }
};
constexpr std::array<SignPair, 4> sign_pairs{{{1, 1}, {1, -1}, {-1, 1}, {-1, -1}}};

}  // namespace

std::vector<Motion> motions_from_homography(const Eigen::Matrix3d& H_21, const Eigen::Matrix3d& K) {
  const Svd3 svd = svd_3(K.inverse() * H_21 * K);
  const Eigen::Matrix3d &U = svd.U, &V = svd.V;
  const double d_1 = svd.values[0], d_2 = svd.values[1], d_3 = svd.values[2];
  const bool distinct = d_1 >= min_singular_ratio * d_2 && d_2 >= min_singular_ratio * d_3;
  if (!distinct || !(d_3 > 0)) return {};

  const double s = U.determinant() * V.determinant() < 0 ? -1.0 : 1.0;
  const double d_11 = d_1 * d_1, d_22 = d_2 * d_2, d_33 = d_3 * d_3;
  const double x_1 = std::sqrt((d_11 - d_22) / (d_11 - d_33));
  const double x_3 = std::sqrt((d_22 - d_33) / (d_11 - d_33));
  const double root = std::sqrt((d_11 - d_22) * (d_22 - d_33));

  std::vector<Motion> motions;
  const auto add = [&](const Eigen::Matrix3d& R, const Eigen::Vector3d& t) {
    motions.push_back({s * U * R * V.transpose(), (U * t).normalized()});
  };
  {  // d' = +d_2
    const double cosine = (d_22 + d_1 * d_3) / ((d_1 + d_3) * d_2);
    const double sine = root / ((d_1 + d_3) * d_2);
    for (const SignPair& sign : sign_pairs) {
      Eigen::Matrix3d R;
      const double signed_sine = sign.product() * sine;
      R << cosine, 0, -signed_sine, 0, 1, 0, signed_sine, 0, cosine;
      add(R, {sign.first * x_1, 0, -sign.third * x_3});
    }
  }
  {  // d' = -d_2
    const double cosine = (d_1 * d_3 - d_22) / ((d_1 - d_3) * d_2);
    const double sine = root / ((d_1 - d_3) * d_2);
    for (const SignPair& sign : sign_pairs) {
      Eigen::Matrix3d R;
      const double signed_sine = sign.product() * sine;
      R << cosine, 0, signed_sine, 0, -1, 0, signed_sine, 0, -cosine;
      add(R, {sign.first * x_1, 0, sign.third * x_3});
    }
  }
  return motions;
}

std::vector<Motion> motions_from_fundamental(const Eigen::Matrix3d& F_21,
                                             const Eigen::Matrix3d& K) {
  const Svd3 svd = svd_3(K.transpose() * F_21 * K);
  const Eigen::Vector3d t = svd.U.col(2).normalized();
  Eigen::Matrix3d W;
  W << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  Eigen::Matrix3d R_a = svd.U * W * svd.V.transpose();
  Eigen::Matrix3d R_b = svd.U * W.transpose() * svd.V.transpose();
  if (R_a.determinant() < 0) R_a = -R_a;
  if (R_b.determinant() < 0) R_b = -R_b;
  return {{R_a, t}, {R_b, t}, {R_a, -t}, {R_b, -t}};
}

}  // namespace orbslam
