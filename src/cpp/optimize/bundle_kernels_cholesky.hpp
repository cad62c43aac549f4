// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Cholesky factor of a symmetric matrix of six by six blocks, lower triangle by columns of blocks.
// Blocks of zeros stay untouched: keyframes that share no point.

#include "optimize/bundle_lanes.hpp"

namespace orbslam::bundle_kernels {
namespace {

/// Lower factor in place of a diagonal block, with the inverses of its diagonal.
inline bool factorise_diagonal(double* block, double (&inverse)[6]) {
  for (int c = 0; c < 6; ++c) {
    for (int r = c; r < 6; ++r) {
      double value = block[6 * c + r];
      for (int k = 0; k < c; ++k) value -= block[6 * k + r] * block[6 * k + c];
      if (r == c) {
        if (!(value > 0)) return false;
        const double pivot = __builtin_sqrt(value);
        inverse[c] = 1 / pivot;
        block[6 * c + c] = pivot;
      } else {
        block[6 * c + r] = value * inverse[c];
      }
    }
  }
  return inverse[0] + inverse[1] + inverse[2] + inverse[3] + inverse[4] + inverse[5] < 1e150;
}

inline bool is_zero(const double* block) {
  Mask other = load(block) != all(0);
  for (int k = 1; k < 9; ++k) other |= load(block + 4 * k) != all(0);
  return !any(other);
}

/// block = block * L^-T in place, and its columns as products want them.
inline void divide(double* block, const double* L, const double (&inverse)[6], double* columns) {
  Lanes low[6], high[6];
  for (int c = 0; c < 6; ++c) {
    double* column = block + 6 * c;
    low[c] = load(column);
    high[c] = lanes(column[4], column[5], column[0], column[1]);
    for (int k = 0; k < c; ++k) {
      low[c] -= low[k] * all(L[6 * k + c]);
      high[c] -= high[k] * all(L[6 * k + c]);
    }
    low[c] *= all(inverse[c]);
    high[c] *= all(inverse[c]);
    store(column, low[c]);
    column[4] = high[c][0];
    column[5] = high[c][1];
    write_column(columns + kColumnSize * c, low[c], high[c]);
  }
}

bool factorise(double* blocks, Index n, double* scratch) {
  constexpr Size kColumns = 6 * kColumnSize;
  for (Index j = 0; j < n; ++j) {
    double* column = column_of(blocks, n, j);
    double inverse[6];
    if (!factorise_diagonal(column, inverse)) return false;
    double* records = scratch;
    for (Index i = j + 1; i < n; ++i, records += kColumns) {
      double* block = column + Size{kBlockSize} * (i - j);
      records[0] = 0;
      const bool zero = is_zero(block);
      if (!zero) divide(block, column, inverse, records);
      scratch[kColumns * n + i] = zero ? 0 : 1;
    }
    for (Index k = j + 1; k < n; ++k) {
      if (scratch[kColumns * n + k] == 0) continue;
      const double* right = scratch + kColumns * (k - j - 1);
      double* target = column_of(blocks, n, k);
      for (Index i = k; i < n; ++i) {
        if (scratch[kColumns * n + i] == 0) continue;
        subtract_product<6>(target + Size{kBlockSize} * (i - k), scratch + kColumns * (i - j - 1),
                            right);
      }
    }
  }
  return true;
}

void solve(const double* blocks, Index n, double* x) {
  for (Index j = 0; j < n; ++j) {
    const double* block = column_of(const_cast<double*>(blocks), n, j);
    double* y = x + Size{6} * j;
    for (int c = 0; c < 6; ++c) {
      y[c] /= block[6 * c + c];
      for (int r = c + 1; r < 6; ++r) y[r] -= block[6 * c + r] * y[c];
    }
    for (Index i = j + 1; i < n; ++i) {
      block += kBlockSize;
      double* z = x + Size{6} * i;
      for (int c = 0; c < 6; ++c) {
        for (int r = 0; r < 6; ++r) z[r] -= block[6 * c + r] * y[c];
      }
    }
  }
  for (Index j = n; j-- > 0;) {
    const double* diagonal = column_of(const_cast<double*>(blocks), n, j);
    double* y = x + Size{6} * j;
    for (Index i = j + 1; i < n; ++i) {
      const double* block = diagonal + Size{kBlockSize} * (i - j);
      const double* z = x + Size{6} * i;
      for (int c = 0; c < 6; ++c) {
        double product = 0;
        for (int r = 0; r < 6; ++r) product += block[6 * c + r] * z[r];
        y[c] -= product;
      }
    }
    for (int c = 5; c >= 0; --c) {
      for (int r = c + 1; r < 6; ++r) y[c] -= diagonal[6 * c + r] * y[r];
      y[c] /= diagonal[6 * c + c];
    }
  }
}

}  // namespace
}  // namespace orbslam::bundle_kernels
