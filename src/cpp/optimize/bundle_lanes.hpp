// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Four doubles: one register of AVX, or two of what every 64-bit processor has. In an unnamed
// namespace, because it is compiled for two instruction sets (see bundle_kernels.hpp). One source
// already, by the compiler's own vectors and not by Highway as the kernels of images: it is always
// four lanes, because their number decides the order of sums and so the bytes, and it is
// arithmetic, which compilers know how to write for each processor.

#include "optimize/bundle_kernels.hpp"

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace orbslam::bundle_kernels {
namespace {

#if defined(__AVX__)

using Lanes = double __attribute__((vector_size(32)));
using Mask = decltype(Lanes{} < Lanes{});

inline Lanes lanes(double a, double b, double c, double d) { return Lanes{a, b, c, d}; }
inline Lanes load(const double* p) {
  Lanes values;
  __builtin_memcpy(&values, p, sizeof(values));
  return values;
}
inline void store(double* p, Lanes values) { __builtin_memcpy(p, &values, sizeof(values)); }
/// The lanes in the mask, 0 elsewhere; also where they are NaN.
inline Lanes keep(Mask mask, Lanes values) {
  return reinterpret_cast<Lanes>(mask & reinterpret_cast<Mask>(values));
}
inline Lanes choose(Mask mask, Lanes yes, Lanes no) { return mask ? yes : no; }
inline bool any(Mask mask) { return (mask[0] | mask[1] | mask[2] | mask[3]) != 0; }
inline Lanes root(Lanes q) {
  return _mm256_sqrt_pd(q);  // the compiler would keep roots scalar because of errno
}

/// Rows to columns.
inline void transpose(Lanes& a, Lanes& b, Lanes& c, Lanes& d) {
  const Lanes ab_even = __builtin_shufflevector(a, b, 0, 4, 2, 6);
  const Lanes ab_odd = __builtin_shufflevector(a, b, 1, 5, 3, 7);
  const Lanes cd_even = __builtin_shufflevector(c, d, 0, 4, 2, 6);
  const Lanes cd_odd = __builtin_shufflevector(c, d, 1, 5, 3, 7);
  a = __builtin_shufflevector(ab_even, cd_even, 0, 1, 4, 5);
  b = __builtin_shufflevector(ab_odd, cd_odd, 0, 1, 4, 5);
  c = __builtin_shufflevector(ab_even, cd_even, 2, 3, 6, 7);
  d = __builtin_shufflevector(ab_odd, cd_odd, 2, 3, 6, 7);
}

/// 0 0 1 1 and 2 2 3 3.
inline Lanes first_twice(Lanes a) { return __builtin_shufflevector(a, a, 0, 0, 1, 1); }
inline Lanes last_twice(Lanes a) { return __builtin_shufflevector(a, a, 2, 2, 3, 3); }

#else

using Half = double __attribute__((vector_size(16)));
using HalfMask = decltype(Half{} < Half{});

struct Lanes {
  Half low, high;
  double operator[](int i) const { return i < 2 ? low[i] : high[i - 2]; }
};
struct Mask {
  HalfMask low, high;
};

inline Lanes lanes(double a, double b, double c, double d) { return {Half{a, b}, Half{c, d}}; }
inline Lanes load(const double* p) {
  Lanes values;
  __builtin_memcpy(&values.low, p, sizeof(Half));
  __builtin_memcpy(&values.high, p + 2, sizeof(Half));
  return values;
}
inline void store(double* p, const Lanes& values) {
  __builtin_memcpy(p, &values.low, sizeof(Half));
  __builtin_memcpy(p + 2, &values.high, sizeof(Half));
}

inline Lanes operator+(const Lanes& a, const Lanes& b) { return {a.low + b.low, a.high + b.high}; }
inline Lanes operator-(const Lanes& a, const Lanes& b) { return {a.low - b.low, a.high - b.high}; }
inline Lanes operator*(const Lanes& a, const Lanes& b) { return {a.low * b.low, a.high * b.high}; }
inline Lanes operator/(const Lanes& a, const Lanes& b) { return {a.low / b.low, a.high / b.high}; }
inline Lanes operator-(const Lanes& a) { return {-a.low, -a.high}; }
inline Lanes& operator+=(Lanes& a, const Lanes& b) { return a = a + b; }
inline Lanes& operator-=(Lanes& a, const Lanes& b) { return a = a - b; }
inline Lanes& operator*=(Lanes& a, const Lanes& b) { return a = a * b; }
inline Mask operator>(const Lanes& a, const Lanes& b) { return {a.low > b.low, a.high > b.high}; }
inline Mask operator<=(const Lanes& a, const Lanes& b) {
  return {a.low <= b.low, a.high <= b.high};
}
inline Mask operator!=(const Lanes& a, const Lanes& b) {
  return {a.low != b.low, a.high != b.high};
}
inline Mask operator&(const Mask& a, const Mask& b) { return {a.low & b.low, a.high & b.high}; }
inline Mask& operator|=(Mask& a, const Mask& b) { return a = {a.low | b.low, a.high | b.high}; }

inline Half keep(HalfMask mask, Half values) {
  return reinterpret_cast<Half>(mask & reinterpret_cast<HalfMask>(values));
}
/// The lanes in the mask, 0 elsewhere; also where they are NaN.
inline Lanes keep(const Mask& mask, const Lanes& values) {
  return {keep(mask.low, values.low), keep(mask.high, values.high)};
}
inline Lanes choose(const Mask& mask, const Lanes& yes, const Lanes& no) {
  return {mask.low ? yes.low : no.low, mask.high ? yes.high : no.high};
}
inline bool any(const Mask& mask) {
  const HalfMask both = mask.low | mask.high;
  return (both[0] | both[1]) != 0;
}
inline Lanes root(const Lanes& q) {
#if defined(__SSE2__)
  return {_mm_sqrt_pd(q.low), _mm_sqrt_pd(q.high)};
#else
  return lanes(__builtin_sqrt(q[0]), __builtin_sqrt(q[1]), __builtin_sqrt(q[2]),
               __builtin_sqrt(q[3]));
#endif
}

inline Half evens(Half a, Half b) { return __builtin_shufflevector(a, b, 0, 2); }
inline Half odds(Half a, Half b) { return __builtin_shufflevector(a, b, 1, 3); }

/// Rows to columns.
inline void transpose(Lanes& a, Lanes& b, Lanes& c, Lanes& d) {
  const Lanes column_0{evens(a.low, b.low), evens(c.low, d.low)};
  const Lanes column_1{odds(a.low, b.low), odds(c.low, d.low)};
  const Lanes column_2{evens(a.high, b.high), evens(c.high, d.high)};
  const Lanes column_3{odds(a.high, b.high), odds(c.high, d.high)};
  a = column_0;
  b = column_1;
  c = column_2;
  d = column_3;
}

/// 0 0 1 1 and 2 2 3 3.
inline Lanes first_twice(const Lanes& a) { return {evens(a.low, a.low), odds(a.low, a.low)}; }
inline Lanes last_twice(const Lanes& a) { return {evens(a.high, a.high), odds(a.high, a.high)}; }

#endif

inline Lanes all(double value) { return lanes(value, value, value, value); }
inline double sum(const Lanes& a) { return (a[0] + a[1]) + (a[2] + a[3]); }

/// Three lanes of four vectors.
struct Vector3 {
  Lanes x, y, z;
};

inline Vector3 cross(const Vector3& a, const Vector3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// Six numbers of a column in the layout of the block products: f0..f5 f0 f1, then f0 f0 f1 f1, f2
// f2 f3 f3, f4 f4 f5 f5. A block has its columns one after the other, so that two columns are three
// vectors: rows 0 to 3 of one, rows 4, 5 of it and 0, 1 of the other, rows 2 to 5 of that.
constexpr int kColumnSize = 20;

/// `low`: f0..f3, `high`: f4 f5 f0 f1.
inline void write_column(double* column, Lanes low, Lanes high) {
  store(column, low);
  store(column + 4, high);
  store(column + 8, first_twice(low));
  store(column + 12, last_twice(low));
  store(column + 16, first_twice(high));
}

/// block -= rows * columns^T, both of kColumns columns.
template <int kColumns>
inline void subtract_product(double* block, const double* rows, const double* columns) {
  Lanes sums[9];
  for (int k = 0; k < 9; ++k) sums[k] = load(block + 4 * k);
  for (int t = 0; t < kColumns; ++t, rows += kColumnSize, columns += kColumnSize) {
    const Lanes top = load(rows), middle = load(rows + 4), bottom = load(rows + 2);
    for (int k = 0; k < 3; ++k) {
      sums[3 * k] -= top * all(columns[2 * k]);
      sums[3 * k + 1] -= middle * load(columns + 8 + 4 * k);
      sums[3 * k + 2] -= bottom * all(columns[2 * k + 1]);
    }
  }
  for (int k = 0; k < 9; ++k) store(block + 4 * k, sums[k]);
}

/// First block of a column of the lower triangle of n by n blocks.
inline double* column_of(double* blocks, Index n, Index column) {
  const Size before = Size{column} * (2 * Size{n} - column + 1) / 2;
  return blocks + before * kBlockSize;
}

}  // namespace
}  // namespace orbslam::bundle_kernels
