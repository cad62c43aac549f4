// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/small_solvers.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

namespace orbslam {
namespace {

SmallMatrix drawn(int rows, int columns, unsigned seed) {
  std::mt19937 draw(seed);
  SmallMatrix matrix(rows, columns);
  for (int j = 0; j < columns; ++j) {
    for (int i = 0; i < rows; ++i) matrix(i, j) = static_cast<double>(draw()) / 4294967296.0 - 0.5;
  }
  return matrix;
}

TEST(SmallSolvers, EigenvectorsOfSymmetricMatricesOfAllSizes) {
  for (int n = 1; n <= 12; ++n) {
    const SmallMatrix half = drawn(n, n, 1);
    const SmallMatrix matrix = half + half.transpose();
    const auto [values, vectors] = symmetric_eigen(matrix.triangularView<Eigen::Lower>());
    const SmallMatrix scaled = vectors * values.asDiagonal();
    EXPECT_TRUE((matrix * vectors).isApprox(scaled, 1e-12)) << n;
    EXPECT_TRUE((vectors.transpose() * vectors).isIdentity(1e-12)) << n;
    for (int k = 1; k < n; ++k) EXPECT_LE(values[k - 1], values[k]);
  }
}

TEST(SmallSolvers, FourByFourAgreesWithTheGeneralOne) {
  const SmallMatrix half = drawn(4, 4, 2);
  const Eigen::Matrix4d matrix = half + half.transpose();
  const Eigen::Matrix4d vectors = symmetric_eigenvectors_4(matrix);
  const SmallMatrix general = symmetric_eigen(matrix).vectors;
  for (int k = 0; k < 4; ++k) {
    EXPECT_NEAR(std::abs(vectors.col(k).dot(general.col(k))), 1, 1e-12) << k;
  }
}

TEST(SmallSolvers, SingularValuesInDescendingOrder) {
  const Eigen::Matrix3d matrix = drawn(3, 3, 3);
  const Svd3 svd = svd_3(matrix);
  EXPECT_TRUE((svd.U * svd.values.asDiagonal() * svd.V.transpose()).isApprox(matrix, 1e-12));
  EXPECT_GE(svd.values[0], svd.values[1]);
  EXPECT_GE(svd.values[1], svd.values[2]);
}

TEST(SmallSolvers, ResidualsOfLeastSquaresAreOrthogonalToTheColumns) {
  for (int columns = 3; columns <= 5; ++columns) {
    const SmallMatrix A = drawn(6, columns, 4);
    const SmallVector b = drawn(6, 1, 5);
    const SmallVector x = least_squares(A, b);
    EXPECT_LT((A.transpose() * (A * x - b)).norm(), 1e-12) << columns;
  }
}

TEST(SmallSolvers, ShortestSolutionWhereSeveralFitAlike) {
  Eigen::Matrix<double, 6, 4> A = drawn(6, 4, 6);
  A.col(3) = A.col(2);  // what x_2 does, x_3 does as well
  const Eigen::Matrix<double, 6, 1> b = drawn(6, 1, 7);
  const Eigen::Vector4d x = shortest_least_squares(A, b);
  EXPECT_LT((A.transpose() * (A * x - b)).norm(), 1e-12);
  EXPECT_NEAR(x[2], x[3], 1e-12);
}

TEST(SmallSolvers, OrthogonalToAllColumns) {
  const SmallMatrix A = drawn(9, 8, 8);
  const SmallVector x = orthogonal_to_columns(A);
  EXPECT_NEAR(x.norm(), 1, 1e-12);
  EXPECT_LT((A.transpose() * x).norm(), 1e-12);
}

}  // namespace
}  // namespace orbslam
