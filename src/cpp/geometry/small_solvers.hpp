// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace orbslam {

// Decompositions of small matrices, compiled once: one of them costs the compiler as much as a
// dozen sources, and each file that names it would pay again. Sizes that are solved thousands of
// times have a function of their own.

/// Of at most 12 x 12, on the stack. Sizes known to be small, but not unrolled: fully unrolled
/// eigen solvers take the compiler minutes and gigabytes under the sanitizers, and are no faster.
using SmallMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 12, 12>;
using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 12, 1>;

/// Eigenvalues of a symmetric matrix in ascending order, and an eigenvector of each per column.
struct SymmetricEigen {
  SmallVector values;
  SmallMatrix vectors;
};

/// Of a symmetric matrix, of which the lower triangle is read.
SymmetricEigen symmetric_eigen(const SmallMatrix& matrix);

/// The eigenvectors of a symmetric matrix, those of the smallest eigenvalue first.
Eigen::Matrix4d symmetric_eigenvectors_4(const Eigen::Matrix4d& matrix);

/// Unit eigenvector of the least eigenvalue of a symmetric matrix without negative ones, N x N with
/// N = 4 or 9; the lower triangle is read. By inverse iteration, which is faster
/// where that eigenvalue lies well below the others, as it does where a linear model fits its
/// equations.
template <int N>
Eigen::Matrix<double, N, 1> least_eigenvector(const Eigen::Matrix<double, N, N>& matrix);

/// A = U diag(values) V^T of a 3 x 3 matrix, values in descending order.
struct Svd3 {
  Eigen::Matrix3d U;
  Eigen::Vector3d values;
  Eigen::Matrix3d V;
};

Svd3 svd_3(const Eigen::Matrix3d& matrix);

/// x that makes |A x - b| least, by singular values. A has at least as many rows as columns.
SmallVector least_squares(const SmallMatrix& A, const SmallVector& b);

/// The shortest x that makes |A x - b| least, by a complete orthogonal decomposition: faster than
/// singular values, and as good where the rank is clear.
Eigen::Vector4d shortest_least_squares(const Eigen::Matrix<double, 6, 4>& A,
                                       const Eigen::Matrix<double, 6, 1>& b);

/// The last column of Q of A = Q R: a unit vector orthogonal to all columns of A, which has a row
/// more than columns.
SmallVector orthogonal_to_columns(const SmallMatrix& A);

}  // namespace orbslam
