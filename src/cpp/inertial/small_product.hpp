// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace orbslam {

/// A B of fixed sizes, as loops. Eigen would write out every product, which compiles for minutes at
/// these sizes and runs no faster.
template <int kRows, int kInner, int kColumns>
Eigen::Matrix<double, kRows, kColumns> product(const Eigen::Matrix<double, kRows, kInner>& A,
                                               const Eigen::Matrix<double, kInner, kColumns>& B) {
  Eigen::Matrix<double, kRows, kColumns> AB = Eigen::Matrix<double, kRows, kColumns>::Zero();
  double* to = AB.data();
  for (int column = 0; column < kColumns; ++column, to += kRows) {
    const double* from = A.data();
    for (int k = 0; k < kInner; ++k, from += kRows) {
      const double factor = B(k, column);
      for (int row = 0; row < kRows; ++row) to[row] += from[row] * factor;
    }
  }
  return AB;
}

/// A P A^T: the covariance P of x gives that of A x.
template <int kRows, int kInner>
Eigen::Matrix<double, kRows, kRows> transported(
    const Eigen::Matrix<double, kRows, kInner>& A,
    const Eigen::Matrix<double, kInner, kInner>& covariance) {
  const Eigen::Matrix<double, kInner, kRows> transposed = A.transpose();
  return product(product(A, covariance), transposed);
}

}  // namespace orbslam
