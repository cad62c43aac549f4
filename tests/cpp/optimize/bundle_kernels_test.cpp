// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/bundle_kernels.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <vector>

#include "random_bundles.hpp"

namespace orbslam {
namespace {

using bundle_kernels::kBlockSize;
using testing::uniform;

std::vector<const bundle_kernels::Kernels*> all_bundle_kernels() {
  std::vector<const bundle_kernels::Kernels*> kernels{&bundle_kernels::portable_kernels()};
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) kernels.push_back(bundle_kernels::avx2_kernels());
#endif
  return kernels;
}

/// A positive definite matrix of n by n blocks; cameras more than `band` apart share nothing.
Eigen::MatrixXd random_matrix(std::uint64_t seed, Eigen::Index n, Eigen::Index band) {
  std::mt19937_64 random(seed);
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(6 * n, 6 * n);
  for (Eigen::Index r = 0; r < 6 * n; ++r) {
    for (Eigen::Index c = 0; c < r; ++c) {
      if (r / 6 - c / 6 > band) continue;
      matrix(r, c) = matrix(c, r) = uniform(random, -1, 1);
    }
    matrix(r, r) = 6.0 * static_cast<double>(2 * band + 1) + uniform(random, 0, 1);
  }
  return matrix;
}

std::vector<double> to_blocks(const Eigen::MatrixXd& matrix) {
  std::vector<double> blocks;
  for (Eigen::Index column = 0; column < matrix.rows(); column += 6) {
    for (Eigen::Index row = column; row < matrix.rows(); row += 6) {
      for (Eigen::Index c = 0; c < 6; ++c) {
        for (Eigen::Index r = 0; r < 6; ++r) blocks.push_back(matrix(row + r, column + c));
      }
    }
  }
  return blocks;
}

TEST(BundleKernels, SolvesAsADenseCholeskyDoes) {
  for (const Eigen::Index n : {1, 2, 7, 25}) {
    for (const Eigen::Index band : {Eigen::Index{2}, n}) {
      const Eigen::MatrixXd matrix = random_matrix(static_cast<std::uint64_t>(n), n, band);
      std::mt19937_64 random(7);
      Eigen::VectorXd right(6 * n);
      for (double& value : right) value = uniform(random, -10, 10);
      const Eigen::VectorXd expected = matrix.llt().solve(right);
      for (const bundle_kernels::Kernels* kernels : all_bundle_kernels()) {
        std::vector<double> blocks = to_blocks(matrix);
        std::vector<double> scratch(bundle_kernels::kFactoriseSize * static_cast<std::size_t>(n));
        Eigen::VectorXd solution = right;
        const auto size = static_cast<bundle_kernels::Index>(n);
        ASSERT_TRUE(kernels->factorise(blocks.data(), size, scratch.data())) << kernels->name;
        kernels->solve(blocks.data(), size, solution.data());
        EXPECT_LT((solution - expected).cwiseAbs().maxCoeff(), 1e-12) << kernels->name << n;
      }
    }
  }
}

TEST(BundleKernels, MatricesThatAreNotPositiveDefiniteHaveNoFactor) {
  for (const bundle_kernels::Kernels* kernels : all_bundle_kernels()) {
    for (const double wrong : {0.0, -1.0, std::nan("")}) {
      Eigen::MatrixXd matrix = random_matrix(3, 4, 4);
      matrix(15, 15) = wrong;
      std::vector<double> blocks = to_blocks(matrix);
      std::vector<double> scratch(bundle_kernels::kFactoriseSize * 4);
      EXPECT_FALSE(kernels->factorise(blocks.data(), 4, scratch.data())) << kernels->name;
    }
  }
}

TEST(BundleKernels, AllGiveTheSameFactorBitByBit) {
  const Eigen::MatrixXd matrix = random_matrix(5, 12, 4);
  std::vector<std::vector<double>> factors;
  for (const bundle_kernels::Kernels* kernels : all_bundle_kernels()) {
    factors.push_back(to_blocks(matrix));
    std::vector<double> scratch(bundle_kernels::kFactoriseSize * 12);
    ASSERT_TRUE(kernels->factorise(factors.back().data(), 12, scratch.data()));
    EXPECT_EQ(factors.back(), factors.front()) << kernels->name;
  }
}

}  // namespace
}  // namespace orbslam
