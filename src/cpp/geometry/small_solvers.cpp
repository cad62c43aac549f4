// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/small_solvers.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>

namespace orbslam {

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
