// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/small_solvers.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>

namespace orbslam {
namespace {

constexpr int most_steps = 8;  // of inverse iteration; more cost what the eigenvalue solver does
constexpr double settled = 1e-11;  // change of a unit vector by one step
constexpr double rounding = 1e-16;

/// M = L D L^T of a symmetric matrix without negative eigenvalues.
template <int N>
struct Factors {
  Eigen::Matrix<double, N, N> L;  // below the diagonal of ones
  Eigen::Matrix<double, N, 1> d;

  /// False if the matrix is singular by more than one direction, negative, or not finite.
  bool take(const Eigen::Matrix<double, N, N>& M) {
    const double floor = rounding * M.trace();
    for (int k = 0; k < N; ++k) {
      double pivot = M(k, k);
      for (int j = 0; j < k; ++j) pivot -= L(k, j) * L(k, j) * d[j];
      // The rounding of the last pivot does not matter: its direction is the wanted one.
      if (k == N - 1 && pivot < floor) pivot = floor;
      if (!(pivot >= floor) || !(pivot > 0)) return false;
      d[k] = pivot;
      for (int i = k + 1; i < N; ++i) {
        double value = M(i, k);
        for (int j = 0; j < k; ++j) value -= L(i, j) * L(k, j) * d[j];
        L(i, k) = value / pivot;
      }
    }
    return true;
  }

  void solve_transposed(Eigen::Matrix<double, N, 1>& x) const {
    for (int i = N - 2; i >= 0; --i) {
      for (int j = i + 1; j < N; ++j) x[i] -= L(j, i) * x[j];
    }
  }

  void solve(Eigen::Matrix<double, N, 1>& x) const {
    for (int i = 1; i < N; ++i) {
      for (int j = 0; j < i; ++j) x[i] -= L(i, j) * x[j];
    }
    for (int i = 0; i < N; ++i) x[i] /= d[i];
    solve_transposed(x);
  }
};

/// False if it does not converge: another eigenvalue is as small, or the matrix is invalid.
template <int N>
bool iterate(const Eigen::Matrix<double, N, N>& matrix, Eigen::Matrix<double, N, 1>& vector) {
  Factors<N> factors;
  if (!factors.take(matrix)) return false;
  vector.setZero();
  vector[N - 1] = 1;
  factors.solve_transposed(vector);  // what is left of the last direction, all others taken out
  vector /= vector.norm();
  for (int step = 0; step < most_steps; ++step) {
    const Eigen::Matrix<double, N, 1> before = vector;
    factors.solve(vector);
    vector /= vector.norm();
    if ((vector - before).cwiseAbs().maxCoeff() < settled) return true;
  }
  return false;
}

}  // namespace

template <int N>
Eigen::Matrix<double, N, 1> least_eigenvector(const Eigen::Matrix<double, N, N>& matrix) {
  Eigen::Matrix<double, N, 1> vector;
  if (iterate<N>(matrix, vector)) return vector;
  if constexpr (N == 4) {
    return symmetric_eigenvectors_4(matrix).col(0);
  } else {
    return symmetric_eigen(matrix).vectors.col(0);
  }
}

template Eigen::Matrix<double, 4, 1> least_eigenvector<4>(const Eigen::Matrix<double, 4, 4>&);
template Eigen::Matrix<double, 9, 1> least_eigenvector<9>(const Eigen::Matrix<double, 9, 9>&);

SymmetricEigen symmetric_eigen(const SmallMatrix& matrix) {
  const Eigen::SelfAdjointEigenSolver<SmallMatrix> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

Eigen::Matrix4d symmetric_eigenvectors_4(const Eigen::Matrix4d& matrix) {
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d>(matrix).eigenvectors();
}

Svd3 svd_3(const Eigen::Matrix3d& matrix) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return {svd.matrixU(), svd.singularValues(), svd.matrixV()};
}

SmallVector least_squares(const SmallMatrix& A, const SmallVector& b) {
  const Eigen::JacobiSVD<SmallMatrix> svd(A, Eigen::ComputeThinU | Eigen::ComputeThinV);
  return svd.solve(b);
}

Eigen::Vector4d shortest_least_squares(const Eigen::Matrix<double, 6, 4>& A,
                                       const Eigen::Matrix<double, 6, 1>& b) {
  return A.completeOrthogonalDecomposition().solve(b);
}

SmallVector orthogonal_to_columns(const SmallMatrix& A) {
  const Eigen::HouseholderQR<SmallMatrix> qr(A);
  return qr.householderQ() * SmallVector::Unit(A.rows(), A.rows() - 1);
}

}  // namespace orbslam
