// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Compiled for two instruction sets: see bundle_kernels.hpp for what may be included.

#include "optimize/pose_sums.hpp"

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace orbslam::pose_sums {
namespace {

// One register's worth of the four lanes: all of them, or two at a time, in two passes. A lane's
// sum is the same either way.
#if defined(__AVX__)
constexpr Size kWidth = 4;
using Lanes = double __attribute__((vector_size(32)));
inline Lanes all(double value) { return Lanes{value, value, value, value}; }
inline Lanes root(Lanes q) {
  return _mm256_sqrt_pd(q);  // the compiler would keep roots scalar because of errno
}
inline double sum(Lanes a) { return a[0] + a[1] + (a[2] + a[3]); }
#else
constexpr Size kWidth = 2;
using Lanes = double __attribute__((vector_size(16)));
inline Lanes all(double value) { return Lanes{value, value}; }
inline Lanes root(Lanes q) {
#if defined(__SSE2__)
  return _mm_sqrt_pd(q);
#else
  return Lanes{__builtin_sqrt(q[0]), __builtin_sqrt(q[1])};
#endif
}
inline double sum(Lanes a) { return a[0] + a[1]; }
#endif
constexpr Size kPasses = kLanes / kWidth;

using Mask = decltype(Lanes{} < Lanes{});

inline Lanes load(const double* p) {
  Lanes values;
  __builtin_memcpy(&values, p, sizeof(values));
  return values;
}
/// The lanes in the mask, 0 elsewhere; also where they are NaN.
inline Lanes keep(Mask mask, Lanes values) {
  return reinterpret_cast<Lanes>(mask & reinterpret_cast<Mask>(values));
}

constexpr int kUnknowns = 6;
constexpr int kTriangle = 21;

struct Sums {
  // Lower triangle of H, row by row, and the right-hand side.
  Lanes h[kTriangle];
  Lanes b[kUnknowns];
};

/// Adds weight * J^T J and -weight * J^T e. The entry named `kZero`, if not negative, is known to
/// be zero.
template <int kZero>
inline void add_row(Sums& sums, const Lanes (&jacobian)[kUnknowns], Lanes weight, Lanes error) {
  int k = 0;
  for (int row = 0; row < kUnknowns; ++row) {
    if (row == kZero) {
      k += row + 1;
      continue;
    }
    const Lanes weighted = weight * jacobian[row];
    sums.b[row] -= weighted * error;
    for (int column = 0; column <= row; ++column, ++k) {
      if (column == kZero) continue;
      sums.h[k] += weighted * jacobian[column];
    }
  }
}

/// Adds the rows u, v and, with depth, right u of points at (x, y) on the normalised image plane.
template <bool kStereo>
inline void add_points(Sums& sums, Lanes x, Lanes y, Lanes inverse_z, Lanes base,
                       const Lanes (&errors)[3], Lanes weight_u, Lanes weight_v, Lanes weight_r) {
  const Lanes one = all(1.0), zero = all(0.0), xy = x * y;
  const Lanes row_u[kUnknowns] = {xy, -(one + x * x), y, -inverse_z, zero, x * inverse_z};
  const Lanes row_v[kUnknowns] = {one + y * y, -xy, -x, zero, -inverse_z, y * inverse_z};
  add_row<4>(sums, row_u, weight_u, errors[0]);
  add_row<3>(sums, row_v, weight_v, errors[1]);
  if constexpr (kStereo) {
    const Lanes beta = base * inverse_z;
    const Lanes row_right[kUnknowns] = {
        row_u[0] - beta * y, row_u[1] + beta * x, y, -inverse_z, zero, row_u[5] - beta * inverse_z};
    add_row<4>(sums, row_right, weight_r, errors[2]);
  }
}

/// Four points in the camera frame.
struct CameraPoints {
  Lanes x, y, z;
};

inline CameraPoints transformed(const Task& task, Size i) {
  const double* const R = task.rotation;
  const Lanes xw = load(task.x + i), yw = load(task.y + i), zw = load(task.z + i);
  return {all(R[0]) * xw + all(R[1]) * yw + all(R[2]) * zw + all(task.translation[0]),
          all(R[3]) * xw + all(R[4]) * yw + all(R[5]) * zw + all(task.translation[1]),
          all(R[6]) * xw + all(R[7]) * yw + all(R[8]) * zw + all(task.translation[2])};
}

/// Adds the row of a residual with the derivative (a, b, c) by the point in the camera frame.
inline void add_general_row(Sums& sums, const CameraPoints& p, Lanes a, Lanes b, Lanes c,
                            Lanes weight, Lanes error) {
  const Lanes row[kUnknowns] = {p.y * c - p.z * b, p.z * a - p.x * c, p.x * b - p.y * a, a, b, c};
  add_row<-1>(sums, row, weight, error);
}

/// Any camera: the error of a point p against its keypoint is (q.x, q.y) / q.z in pixels with
/// q = B (p; 1) and B the keypoint's sight, and its disparity is bf / q.z.
template <bool kStereo, bool kRobust, bool kSystem>
inline double accumulate_sights(const Task& task, Size first, double* system) {
  const Lanes huber2 = all(task.huber * task.huber), width = all(task.huber);
  const Lanes one = all(1.0), tiny2 = all(kTinyDepth * kTinyDepth), bf = all(task.bf);
  Sums sums;
  for (Lanes& entry : sums.h) entry = all(0.0);
  for (Lanes& entry : sums.b) entry = all(0.0);
  Lanes cost = all(0.0);
  for (Size i = first; i < task.n; i += kLanes) {
    const CameraPoints p = transformed(task, i);
    Lanes B[12];
    for (Size k = 0; k < 12; ++k) B[k] = load(task.sight[k] + i);
    const Lanes q = B[6] * p.x + B[7] * p.y + B[8] * p.z + B[11];
    const Mask usable = q * q > tiny2;
    const Lanes inverse = keep(usable, one / q);
    Lanes weight = keep(usable, load(task.weight + i));
    // Measurement minus prediction.
    const Lanes error_u = -(B[0] * p.x + B[1] * p.y + B[2] * p.z + B[9]) * inverse;
    const Lanes error_v = -(B[3] * p.x + B[4] * p.y + B[5] * p.z + B[10]) * inverse;
    Lanes error_r = all(0.0), factor = one;
    Lanes square = error_u * error_u + error_v * error_v;
    if constexpr (kStereo) {
      const Lanes disparity = load(task.u + i) - load(task.right_u + i);
      error_r = error_u - disparity + bf * inverse;
      factor = load(task.right_factor + i);
      square += factor * (error_r * error_r);
    }
    square *= weight;
    if constexpr (kRobust) {
      const Mask inside = square <= huber2;
      const Lanes distance = root(square);
      cost += inside ? square : all(2.0) * width * distance - huber2;
      weight *= inside ? one : width / distance;
    } else {
      cost += square;
    }
    if constexpr (kSystem) {
      const Lanes ua = -(B[0] + error_u * B[6]) * inverse, ub = -(B[1] + error_u * B[7]) * inverse;
      const Lanes uc = -(B[2] + error_u * B[8]) * inverse;
      add_general_row(sums, p, ua, ub, uc, weight, error_u);
      add_general_row(sums, p, -(B[3] + error_v * B[6]) * inverse,
                      -(B[4] + error_v * B[7]) * inverse, -(B[5] + error_v * B[8]) * inverse,
                      weight, error_v);
      if constexpr (kStereo) {
        const Lanes by_q = bf * inverse * inverse;
        add_general_row(sums, p, ua - by_q * B[6], ub - by_q * B[7], uc - by_q * B[8],
                        weight * factor, error_r);
      }
    }
  }
  if constexpr (kSystem) {
    for (int k = 0; k < kTriangle; ++k) system[k] += sum(sums.h[k]);
    for (int k = 0; k < kUnknowns; ++k) system[kTriangle + k] += sum(sums.b[k]);
  }
  return sum(cost);
}

/// On the normalised image plane every residual is in units of the focal length of its row, which
/// moves into the weight of the row.
template <bool kStereo, bool kRobust, bool kSystem>
inline double accumulate_lanes(const Task& task, Size first, double* system) {
  const double* const R = task.rotation;
  const Lanes r00 = all(R[0]), r01 = all(R[1]), r02 = all(R[2]);
  const Lanes r10 = all(R[3]), r11 = all(R[4]), r12 = all(R[5]);
  const Lanes r20 = all(R[6]), r21 = all(R[7]), r22 = all(R[8]);
  const Lanes tx = all(task.translation[0]), ty = all(task.translation[1]),
              tz = all(task.translation[2]);
  const Lanes inverse_fx = all(1.0 / task.fx), inverse_fy = all(1.0 / task.fy);
  const Lanes cx = all(task.cx), cy = all(task.cy);
  const Lanes fx2 = all(task.fx * task.fx), fy2 = all(task.fy * task.fy);
  const Lanes base = all(task.base);
  const Lanes huber2 = all(task.huber * task.huber), width = all(task.huber);
  const Lanes one = all(1.0), tiny2 = all(kTinyDepth * kTinyDepth);

  Sums sums;
  for (Lanes& entry : sums.h) entry = all(0.0);
  for (Lanes& entry : sums.b) entry = all(0.0);
  Lanes cost = all(0.0);
  for (Size i = first; i < task.n; i += kLanes) {
    const Lanes xw = load(task.x + i), yw = load(task.y + i), zw = load(task.z + i);
    const Lanes xc = r00 * xw + r01 * yw + r02 * zw + tx;
    const Lanes yc = r10 * xw + r11 * yw + r12 * zw + ty;
    const Lanes zc = r20 * xw + r21 * yw + r22 * zw + tz;
    const Mask usable = zc * zc > tiny2;
    const Lanes inverse_z = keep(usable, one / zc);
    const Lanes weight = keep(usable, load(task.weight + i));
    const Lanes x = xc * inverse_z, y = yc * inverse_z;

    const Lanes error_u = (load(task.u + i) - cx) * inverse_fx - x;
    const Lanes error_v = (load(task.v + i) - cy) * inverse_fy - y;
    Lanes error_r = all(0.0);
    Lanes weight_u = weight * fx2, weight_v = weight * fy2, weight_r = weight_u;
    Lanes q = weight_u * error_u * error_u + weight_v * error_v * error_v;
    if constexpr (kStereo) {
      error_r = (load(task.right_u + i) - cx) * inverse_fx - x + base * inverse_z;
      weight_r *= load(task.right_factor + i);
      q += weight_r * error_r * error_r;
    }
    if constexpr (kRobust) {
      const Mask inside = q <= huber2;
      const Lanes distance = root(q);
      cost += inside ? q : all(2.0) * width * distance - huber2;
      const Lanes scale = inside ? one : width / distance;
      weight_u *= scale;
      weight_v *= scale;
      weight_r *= scale;
    } else {
      cost += q;
    }
    if constexpr (kSystem) {
      const Lanes errors[3] = {error_u, error_v, error_r};
      add_points<kStereo>(sums, x, y, inverse_z, base, errors, weight_u, weight_v, weight_r);
    }
  }
  if constexpr (kSystem) {
    for (int k = 0; k < kTriangle; ++k) system[k] += sum(sums.h[k]);
    for (int k = 0; k < kUnknowns; ++k) system[kTriangle + k] += sum(sums.b[k]);
  }
  return sum(cost);
}

template <bool kStereo, bool kRobust, bool kSystem>
double accumulate(const Task& task, double* system) {
  if constexpr (kSystem) {
    for (Size k = 0; k < kSystemSize; ++k) system[k] = 0;
  }
  double cost = 0;
  for (Size pass = 0; pass < kPasses; ++pass) {
    const Size first = pass * kWidth;
    cost += task.has_sights ? accumulate_sights<kStereo, kRobust, kSystem>(task, first, system)
                            : accumulate_lanes<kStereo, kRobust, kSystem>(task, first, system);
  }
  return cost;
}

template <bool kStereo>
double dispatch(const Task& task, double* system) {
  if (system == nullptr) {
    return task.huber > 0 ? accumulate<kStereo, true, false>(task, nullptr)
                          : accumulate<kStereo, false, false>(task, nullptr);
  }
  return task.huber > 0 ? accumulate<kStereo, true, true>(task, system)
                        : accumulate<kStereo, false, true>(task, system);
}

}  // namespace
}  // namespace orbslam::pose_sums
