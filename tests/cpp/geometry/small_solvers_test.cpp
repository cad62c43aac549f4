// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/small_solvers.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>
#include <utility>

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

/// A symmetric matrix with these eigenvalues, and the eigenvector of the first.
template <int N>
std::pair<Eigen::Matrix<double, N, N>, Eigen::Matrix<double, N, 1>> with_eigenvalues(
    const Eigen::Matrix<double, N, 1>& values, unsigned seed) {
  const SmallMatrix half = drawn(N, N, seed);
  const SmallMatrix vectors = symmetric_eigen(half + half.transpose()).vectors;
  return {vectors * values.asDiagonal() * vectors.transpose(), vectors.col(0)};
}

TEST(SmallSolvers, LeastEigenvectorWhateverTheOthersAre) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    for (const double least : {0.0, 1e-9, 1e-3, 0.1, 0.9}) {
      const auto [four, of_four] = with_eigenvalues<4>({least, 1, 3e2, 5e5}, seed);
      EXPECT_NEAR(std::abs(least_eigenvector<4>(four).dot(of_four)), 1, 1e-11) << least;
      Eigen::Matrix<double, 9, 1> values;
      values << least, 1, 1.5, 2, 4, 30, 60, 1e3, 1e4;
      const auto [nine, of_nine] = with_eigenvalues<9>(values, seed);
      EXPECT_NEAR(std::abs(least_eigenvector<9>(nine).dot(of_nine)), 1, 1e-11) << least;
    }
  }
}

TEST(SmallSolvers, LeastEigenvectorSolvesItsEquation) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    const Eigen::Matrix4d half = drawn(4, 4, seed);
    const Eigen::Matrix4d matrix = half.transpose() * half;
    const Eigen::Vector4d vector = least_eigenvector<4>(matrix);
    const double value = symmetric_eigen(matrix).values[0];
    EXPECT_NEAR(vector.norm(), 1, 1e-12);
    EXPECT_LT((matrix * vector - value * vector).norm(), 1e-11);
  }
}

TEST(SmallSolvers, LeastEigenvectorOfMatricesOutOfOrder) {
  // Two directions are lost, or all: one of them.
  const Eigen::Vector4d values(0, 0, 1, 2);
  EXPECT_LT((values.asDiagonal() * least_eigenvector<4>(values.asDiagonal())).norm(), 1e-12);
  EXPECT_NEAR(least_eigenvector<4>(Eigen::Matrix4d::Zero()).norm(), 1, 1e-12);
  // Negative eigenvalues: the least of all, as the eigenvalue solver gives it.
  const Eigen::Vector4d negative(3, -2, 1, -1);
  EXPECT_NEAR(std::abs(least_eigenvector<4>(negative.asDiagonal())[1]), 1, 1e-12);
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
