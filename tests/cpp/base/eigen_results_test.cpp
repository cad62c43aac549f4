// SPDX-License-Identifier: BSD-3-Clause
//
// Eigen as this project compiles it gives the same bytes on every kind of processor: the expected
// ones were computed on x86-64. It would not with fused multiply-add, blocks of another size, or
// caches of another size that it asks the processor for (cmake/folder_library.cmake,
// cmake/aarch64).
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cstdint>
#include <cstring>

namespace orbslam {
namespace {

/// Numbers in [-1, 1) that are the same everywhere.
Eigen::MatrixXd drawn_numbers(Eigen::Index rows, Eigen::Index cols, std::uint64_t seed) {
  Eigen::MatrixXd m(rows, cols);
  for (Eigen::Index j = 0; j < cols; ++j) {
    for (Eigen::Index i = 0; i < rows; ++i) {
      seed = seed * 6364136223846793005U + 1442695040888963407U;
      m(i, j) = static_cast<double>(seed >> 11) / 4503599627370496.0 - 1;
    }
  }
  return m;
}

std::uint64_t hash_of(const Eigen::MatrixXd& m) {
  std::uint64_t sum = 14695981039346656037U;
  for (Eigen::Index k = 0; k < m.size(); ++k) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, m.data() + k, sizeof(bits));
    sum = (sum ^ bits) * 1099511628211U;
  }
  return sum;
}

class EigenResults : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!EIGEN_VERSION_AT_LEAST(3, 4, 0) || EIGEN_VERSION_AT_LEAST(3, 4, 1)) {
      GTEST_SKIP() << "the bytes are those of Eigen 3.4.0";
    }
  }
};

TEST_F(EigenResults, ProductsOfSquareMatrices) {
  const Eigen::MatrixXd a = drawn_numbers(60, 60, 1), b = drawn_numbers(60, 60, 2);
  EXPECT_EQ(hash_of(a * b.transpose()), 0x6e2f8c6825173897U);
}

TEST_F(EigenResults, SumsOverManyPoints) {
  const Eigen::Matrix3Xd a = drawn_numbers(3, 2000, 3), b = drawn_numbers(3, 2000, 4);
  EXPECT_EQ(hash_of(a * b.transpose()), 0x7523b2ba4c22f041U);
}

TEST_F(EigenResults, ProductsWithAVector) {
  const Eigen::MatrixXd a = drawn_numbers(300, 301, 5);
  const Eigen::VectorXd b = drawn_numbers(300, 1, 6);
  EXPECT_EQ(hash_of(a.transpose() * b), 0x4c592cbd8d6c54edU);
}

TEST_F(EigenResults, TriangularSystemsOfManyRightSides) {
  Eigen::MatrixXd a = drawn_numbers(180, 180, 7), b = drawn_numbers(180, 90, 8);
  a.diagonal().array() += 20;
  a.triangularView<Eigen::Lower>().solveInPlace(b);
  EXPECT_EQ(hash_of(b), 0x33778b0d7c50df35U);
}

}  // namespace
}  // namespace orbslam
