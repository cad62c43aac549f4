// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Residuals, derivatives and the elimination of points. See docs/method/adjustment.md#blocks.

#include "optimize/bundle_lanes.hpp"

namespace orbslam::bundle_kernels {
namespace {

constexpr double kTinyDepth = 1e-9;
// Bounds of curvatures that damp.
constexpr double kLeastCurvature = 1e-6, kMostCurvature = 1e32;

/// Four observations at an estimate.
struct Sight {
  Lanes R[3][3];
  Vector3 p;                       ///< in the camera frame; 0 where it takes no part
  Lanes x, y, right_x, inverse_z;  ///< on the normalised plane; right_x in the right camera's
  Lanes error_u, error_v, error_right;
  Lanes weight_u, weight_v, weight_right;  ///< with those of the kernel
  // With sights x and y are pixels less those of the keypoint.
  Lanes B[3][3], inverse_q, base;
};

/// From the points in the camera frame, for any camera: see Sight in camera/camera.hpp.
inline void compare(const Observations& o, Size i, const Lanes (&p)[3], Sight& s) {
  Lanes q[3];
  for (int row = 0; row < 3; ++row) {
    for (int k = 0; k < 3; ++k) s.B[row][k] = load(o.sight[3 * row + k] + i);
    q[row] =
        s.B[row][0] * p[0] + (s.B[row][1] * p[1] + s.B[row][2] * p[2]) + load(o.sight[9 + row] + i);
  }
  const Lanes tiny2 = all(kTinyDepth * kTinyDepth);
  const Lanes weight_u = load(o.weight_u + i), weight_right = load(o.weight_right + i);
  const Mask on = (weight_u > all(0)) & (q[2] * q[2] > tiny2);
  s.p = {keep(on, p[0]), keep(on, p[1]), keep(on, p[2])};
  s.weight_u = keep(on, weight_u);
  s.weight_v = keep(on, load(o.weight_v + i));
  s.weight_right = keep(on, weight_right);
  s.inverse_q = keep(on, all(1) / q[2]);
  s.inverse_z = keep(s.weight_right > all(0), s.inverse_q);
  s.x = keep(on, q[0]) * s.inverse_q;
  s.y = keep(on, q[1]) * s.inverse_q;
  s.base = load(o.base + i);
  s.right_x = s.x - s.base * s.inverse_z;
  s.error_u = -s.x;
  s.error_v = -s.y;
  s.error_right = keep(s.weight_right > all(0), -load(o.right_u + i) - s.right_x);
}

template <bool kSights>
inline void project(const Observations& o, Size i, const Task& task, Sight& s) {
  Lanes X[4];
  for (int k = 0; k < 4; ++k) X[k] = load(task.points + Size{kPointSize} * o.point[i + k]);
  transpose(X[0], X[1], X[2], X[3]);
  Lanes p[3];
  for (int row = 0; row < 3; ++row) {
    Lanes r[4];
    for (int k = 0; k < 4; ++k) {
      r[k] = load(task.views + Size{kViewSize} * o.view[i + k] + 4 * row);
    }
    transpose(r[0], r[1], r[2], r[3]);
    p[row] = (r[0] * X[0] + r[1] * X[1]) + (r[2] * X[2] + r[3]);
    for (int k = 0; k < 3; ++k) s.R[row][k] = r[k];
  }
  if constexpr (kSights) return compare(o, i, p, s);
  const Lanes weight_u = load(o.weight_u + i);
  const Mask on = (weight_u > all(0)) & (p[2] * p[2] > all(kTinyDepth * kTinyDepth));
  s.p = {keep(on, p[0]), keep(on, p[1]), keep(on, p[2])};
  s.inverse_z = keep(on, all(1) / p[2]);
  s.weight_u = keep(on, weight_u);
  s.weight_v = keep(on, load(o.weight_v + i));
  s.weight_right = keep(on, load(o.weight_right + i));
  s.x = s.p.x * s.inverse_z;
  s.y = s.p.y * s.inverse_z;
  s.right_x = s.x - load(o.base + i) * s.inverse_z;
  s.error_u = load(o.u + i) - s.x;
  s.error_v = load(o.v + i) - s.y;
  s.error_right = load(o.right_u + i) - s.right_x;
}

/// Squares of residuals, robustified; puts the kernel's weight into the weights.
template <bool kRobust>
inline Lanes weigh(const Task& task, Sight& s) {
  const Lanes q =
      s.weight_u * s.error_u * s.error_u +
      (s.weight_v * s.error_v * s.error_v + s.weight_right * s.error_right * s.error_right);
  if constexpr (!kRobust) return q;
  const Mask depth = s.weight_right > all(0);
  const Lanes width = choose(depth, all(task.huber_stereo), all(task.huber_mono));
  const Lanes distance = root(q);
  const Mask inside = distance <= width;
  const Lanes scale = choose(inside, all(1), width / distance);
  s.weight_u *= scale;
  s.weight_v *= scale;
  s.weight_right *= scale;
  return choose(inside, q, width * (all(2) * distance - width));
}

/// J^T W J and J^T W e of the projection by the point in the camera frame. Entry 01 is 0 of a
/// pinhole.
struct Normal {
  Lanes m00, m01, m02, m11, m12, m22;
  Vector3 b;
};

/// Adds a row (a, b, c) of the derivative.
inline void add_row(Normal& n, const Lanes (&row)[3], Lanes weight, Lanes error) {
  const Lanes a = weight * row[0], b = weight * row[1], c = weight * row[2];
  n.m00 += a * row[0];
  n.m01 += a * row[1];
  n.m02 += a * row[2];
  n.m11 += b * row[1];
  n.m12 += b * row[2];
  n.m22 += c * row[2];
  n.b.x += a * error;
  n.b.y += b * error;
  n.b.z += c * error;
}

inline Normal normal_equations_of_sights(const Sight& s) {
  const Lanes zero = all(0);
  Normal n{zero, zero, zero, zero, zero, zero, {zero, zero, zero}};
  Lanes row_u[3], row_v[3];
  for (int k = 0; k < 3; ++k) {
    row_u[k] = (s.B[0][k] - s.x * s.B[2][k]) * s.inverse_q;
    row_v[k] = (s.B[1][k] - s.y * s.B[2][k]) * s.inverse_q;
  }
  add_row(n, row_u, s.weight_u, s.error_u);
  add_row(n, row_v, s.weight_v, s.error_v);
  const Lanes by_q = s.base * s.inverse_z * s.inverse_z;
  for (int k = 0; k < 3; ++k) row_u[k] += by_q * s.B[2][k];
  add_row(n, row_u, s.weight_right, s.error_right);
  return n;
}

template <bool kSights>
inline Normal normal_equations(const Sight& s) {
  if constexpr (kSights) return normal_equations_of_sights(s);
  const Lanes u = s.weight_u * s.inverse_z, v = s.weight_v * s.inverse_z;
  const Lanes right = s.weight_right * s.inverse_z;
  const Lanes ux = u * s.x, vy = v * s.y, rx = right * s.right_x;
  Normal n;
  n.m00 = (u + right) * s.inverse_z;
  n.m01 = all(0);
  n.m02 = -(ux + rx) * s.inverse_z;
  n.m11 = v * s.inverse_z;
  n.m12 = -vy * s.inverse_z;
  n.m22 = (ux * s.x + (rx * s.right_x + vy * s.y)) * s.inverse_z;
  n.b.x = u * s.error_u + right * s.error_right;
  n.b.y = v * s.error_v;
  n.b.z = -(ux * s.error_u + (rx * s.error_right + vy * s.error_v));
  return n;
}

/// Adds 28 numbers of each of `count` lanes to their cameras.
inline void add_to_cameras(Lanes (&values)[28], const Index* view, Size count, double* cameras) {
  for (int k = 0; k < 28; k += 4) {
    transpose(values[k], values[k + 1], values[k + 2], values[k + 3]);
  }
  for (Size lane = 0; lane < count; ++lane) {
    double* sums = cameras + Size{kCameraSize} * view[lane];
    for (int k = 0; k < 7; ++k) {
      store(sums + 4 * k, load(sums + 4 * k) + values[4 * k + static_cast<int>(lane)]);
    }
  }
}

/// A^T M A and A^T b with A = (-[p]x, I), the derivative of the point by the camera's step.
inline void camera_equations(const Vector3& p, const Normal& n, Lanes (&out)[28]) {
  const Lanes zero = all(0);
  const Vector3 k0 = cross(p, {n.m00, n.m01, n.m02});  // columns of [p]x M
  const Vector3 k1 = cross(p, {n.m01, n.m11, n.m12});
  const Vector3 k2 = cross(p, {n.m02, n.m12, n.m22});
  const Vector3 t0 = cross(p, {k0.x, k1.x, k2.x});  // rows of [p]x M [p]x^T
  const Vector3 t1 = cross(p, {k0.y, k1.y, k2.y});
  const Vector3 t2 = cross(p, {k0.z, k1.z, k2.z});
  const Vector3 torque = cross(p, n.b);
  const Lanes values[28] = {t0.x,     t1.x,     t1.y,     t2.x,  t2.y,  t2.z,  k0.x,
                            k0.y,     k0.z,     n.m00,    k1.x,  k1.y,  k1.z,  n.m01,
                            n.m11,    k2.x,     k2.y,     k2.z,  n.m02, n.m12, n.m22,
                            torque.x, torque.y, torque.z, n.b.x, n.b.y, n.b.z, zero};
  for (int k = 0; k < 28; ++k) out[k] = values[k];
}

/// Arrays of the scratch memory of a batch, which begins at observation `begin`.
struct Batch {
  double* arrays;
  Size stride;
  Size begin;
  double* at(int array, Size i) const {
    return arrays + static_cast<Size>(array) * stride + (i - begin);
  }
};

// Arrays of a batch: lower triangle of R^T M R (6) and R^T b (3), then M R by rows (9).
constexpr int kPointNormal = 0, kPointRight = 6, kCoupling = 9;
constexpr int kFixedArrays = 18;  ///< where those of fixed cameras begin: the first nine

template <bool kFree, bool kRobust, bool kSights>
void linearise(const Task& task, Size end, const Batch& batch) {
  const Observations& o = kFree ? task.free : task.fixed;
  for (Size i = batch.begin; i < end; i += kLanes) {
    Sight s;
    project<kSights>(o, i, task, s);
    weigh<kRobust>(task, s);
    const Normal n = normal_equations<kSights>(s);
    Lanes MR[3][3];
    for (int c = 0; c < 3; ++c) {
      MR[0][c] = n.m00 * s.R[0][c] + n.m02 * s.R[2][c];
      MR[1][c] = n.m11 * s.R[1][c] + n.m12 * s.R[2][c];
      if constexpr (kSights) {
        MR[0][c] += n.m01 * s.R[1][c];
        MR[1][c] += n.m01 * s.R[0][c];
      }
      MR[2][c] = n.m02 * s.R[0][c] + (n.m12 * s.R[1][c] + n.m22 * s.R[2][c]);
    }
    int k = kPointNormal;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c <= r; ++c, ++k) {
        store(batch.at(k, i), s.R[0][r] * MR[0][c] + (s.R[1][r] * MR[1][c] + s.R[2][r] * MR[2][c]));
      }
      store(batch.at(kPointRight + r, i),
            s.R[0][r] * n.b.x + (s.R[1][r] * n.b.y + s.R[2][r] * n.b.z));
    }
    if constexpr (kFree) {
      for (int e = 0; e < 9; ++e) store(batch.at(kCoupling + e, i), MR[e / 3][e % 3]);
      store(task.camera_frame + i, s.p.x);
      store(task.camera_frame + task.stride + i, s.p.y);
      store(task.camera_frame + 2 * task.stride + i, s.p.z);
      Lanes values[28];
      camera_equations(s.p, n, values);
      const Size left = end - i;
      add_to_cameras(values, o.view + i, left < kLanes ? left : kLanes, task.cameras);
    }
  }
}

/// Sums of the nine arrays over the observations of a point.
inline void add_point_equations(const Batch& batch, Size begin, Size end, double (&sums)[9]) {
  for (Size i = begin; i < end; ++i) {
    for (int k = 0; k < 9; ++k) sums[k] += *batch.at(k, i);
  }
}

inline double bounded(double curvature) {
  const double least = curvature > kLeastCurvature ? curvature : kLeastCurvature;
  return least < kMostCurvature ? least : kMostCurvature;
}

/// Inverse of the Cholesky factor of the damped matrix; a point without one stays where it is.
inline void factorise_point(const Task& task, const double (&sums)[9], double* state) {
  double damping[3];
  const int diagonal[3] = {0, 2, 5};
  for (int k = 0; k < 3; ++k) {
    damping[k] = task.damping * (task.damp_scaled ? bounded(sums[diagonal[k]]) : 1);
  }
  const double l00 = __builtin_sqrt(sums[0] + damping[0]), i00 = 1 / l00;
  const double l10 = sums[1] * i00, l20 = sums[3] * i00;
  const double l11 = __builtin_sqrt(sums[2] + damping[1] - l10 * l10), i11 = 1 / l11;
  const double l21 = (sums[4] - l20 * l10) * i11;
  const double l22 = __builtin_sqrt(sums[5] + damping[2] - l20 * l20 - l21 * l21), i22 = 1 / l22;
  const double i10 = -l10 * i00 * i11, i21 = -l21 * i11 * i22;
  const double i20 = -(l20 * i00 + l21 * i10) * i22;
  const double g0 = sums[6], g1 = sums[7], g2 = sums[8];
  const double values[15] = {i00,
                             i10,
                             i11,
                             i20,
                             i21,
                             i22,
                             i00 * g0,
                             i10 * g0 + i11 * g1,
                             i20 * g0 + i21 * g1 + i22 * g2,
                             g0,
                             g1,
                             g2,
                             damping[0],
                             damping[1],
                             damping[2]};
  const bool good = i00 > 0 && i11 > 0 && i22 > 0 && i22 < 1e150;  // false for NaN
  for (int k = 0; k < 15; ++k) state[k] = good ? values[k] : 0;
}

/// Coupling times the transposed inverse factor, and the columns of six of four observations.
inline void write_records(const Task& task, const Batch& batch, Size i, Size count,
                          const double* state, double* records) {
  Lanes G[3][3];  // rows
  for (int r = 0; r < 3; ++r) {
    const Lanes a = load(batch.at(kCoupling + 3 * r, i));
    const Lanes b = load(batch.at(kCoupling + 3 * r + 1, i));
    const Lanes c = load(batch.at(kCoupling + 3 * r + 2, i));
    G[r][0] = a * all(state[0]);
    G[r][1] = a * all(state[1]) + b * all(state[2]);
    G[r][2] = a * all(state[3]) + (b * all(state[4]) + c * all(state[5]));
    for (int t = 0; t < 3; ++t) {
      store(task.coupling + static_cast<Size>(3 * r + t) * task.stride + i, G[r][t]);
    }
  }
  const Vector3 p{load(task.camera_frame + i), load(task.camera_frame + task.stride + i),
                  load(task.camera_frame + 2 * task.stride + i)};
  for (int t = 0; t < 3; ++t) {
    const Vector3 column{G[0][t], G[1][t], G[2][t]};
    const Vector3 torque = cross(p, column);
    Lanes low[4] = {torque.x, torque.y, torque.z, column.x};
    Lanes high[4] = {column.y, column.z, torque.x, torque.y};
    transpose(low[0], low[1], low[2], low[3]);
    transpose(high[0], high[1], high[2], high[3]);
    for (Size lane = 0; lane < count; ++lane) {
      write_column(records + lane * kRecordSize + kColumnSize * t, low[lane], high[lane]);
    }
  }
}

inline void subtract_point(const Task& task, const Batch& batch, const PointRange& range,
                           const double* state, double* records) {
  for (Size i = range.free_begin; i < range.free_end; i += kLanes) {
    const Size left = range.free_end - i;
    write_records(task, batch, i, left < kLanes ? left : kLanes, state,
                  records + (i - range.free_begin) * kRecordSize);
  }
  const Index* view = task.free.view + range.free_begin;
  const Size count = range.free_end - range.free_begin;
  for (Size a = 0; a < count; ++a) {
    const double* columns = records + a * kRecordSize;
    double* reduced = task.reduced + Size{kReducedSize} * view[a];
    Lanes low = load(reduced), high = load(reduced + 4);
    for (int t = 0; t < 3; ++t) {
      low += load(columns + kColumnSize * t) * all(state[6 + t]);
      high += load(columns + kColumnSize * t + 4) * all(state[6 + t]);
    }
    store(reduced, low);
    store(reduced + 4, high);
    double* first = column_of(task.blocks, task.n_free, view[a]);
    for (Size b = a; b < count; ++b) {
      double* block = first + Size{kBlockSize} * (view[b] - view[a]);
      subtract_product<3>(block, records + b * kRecordSize, columns);
      if (view[b] == view[a] && b != a) {  // seen twice by one camera
        subtract_product<3>(block, columns, records + b * kRecordSize);
      }
    }
  }
}

/// Points [begin, end) whose observations fit into a batch; at least one.
inline Index batch_end(const Task& task, Index begin) {
  const PointRange& first = task.ranges[begin];
  Index end = begin + 1;
  while (end < task.point_end && task.ranges[end].free_end - first.free_begin <= kBatch &&
         task.ranges[end].fixed_end - first.fixed_begin <= kBatch) {
    ++end;
  }
  return end;
}

template <bool kRobust, bool kSights>
double sweep(const Task& task, bool only_measure) {
  double largest = 0;
  double* records = task.scratch + kScratchArrays * task.scratch_stride;
  for (Index begin = task.point_begin; begin < task.point_end;) {
    const Index end = batch_end(task, begin);
    const Batch free{task.scratch, task.scratch_stride, task.ranges[begin].free_begin};
    const Batch fixed{task.scratch + kFixedArrays * task.scratch_stride, task.scratch_stride,
                      task.ranges[begin].fixed_begin};
    linearise<true, kRobust, kSights>(task, task.ranges[end - 1].free_end, free);
    linearise<false, kRobust, kSights>(task, task.ranges[end - 1].fixed_end, fixed);
    for (; begin < end; ++begin) {
      const PointRange& range = task.ranges[begin];
      double sums[9] = {};
      add_point_equations(free, range.free_begin, range.free_end, sums);
      add_point_equations(fixed, range.fixed_begin, range.fixed_end, sums);
      if (only_measure) {
        const int diagonal[3] = {0, 2, 5};
        for (const int k : diagonal) largest = sums[k] > largest ? sums[k] : largest;
        continue;
      }
      double* state = task.point_states + Size{kPointStateSize} * begin;
      factorise_point(task, sums, state);
      subtract_point(task, free, range, state, records);
    }
  }
  return largest;
}

template <bool kRobust, bool kSights>
Lanes cost_of(const Task& task, const Observations& o, Size begin, Size end) {
  Lanes cost = all(0);
  for (Size i = begin; i < end; i += kLanes) {
    Sight s;
    project<kSights>(o, i, task, s);
    cost += weigh<kRobust>(task, s);
  }
  return cost;
}

template <bool kRobust, bool kSights>
double total_cost(const Task& task) {
  if (task.point_begin == task.point_end) return 0;
  const PointRange& first = task.ranges[task.point_begin];
  const PointRange& last = task.ranges[task.point_end - 1];
  return sum(cost_of<kRobust, kSights>(task, task.free, first.free_begin, last.free_end)) +
         sum(cost_of<kRobust, kSights>(task, task.fixed, first.fixed_begin, last.fixed_end));
}

bool has_sights(const Task& task) { return task.free.sight[0] != nullptr; }

double cost(const Task& task) {
  if (has_sights(task)) {
    return task.huber_mono > 0 ? total_cost<true, true>(task) : total_cost<false, true>(task);
  }
  return task.huber_mono > 0 ? total_cost<true, false>(task) : total_cost<false, false>(task);
}

double swept(const Task& task, bool only_measure) {
  if (has_sights(task)) {
    return task.huber_mono > 0 ? sweep<true, true>(task, only_measure)
                               : sweep<false, true>(task, only_measure);
  }
  return task.huber_mono > 0 ? sweep<true, false>(task, only_measure)
                             : sweep<false, false>(task, only_measure);
}

double curvature(const Task& task) { return swept(task, true); }

void eliminate(const Task& task) { swept(task, false); }

/// Per observation the coupling times how its camera moves the point in its frame.
inline void couple(const Task& task, Size end, const Batch& batch) {
  for (Size i = batch.begin; i < end; i += kLanes) {
    Lanes turn[4], shift[4];
    for (int k = 0; k < 4; ++k) {
      const double* step = task.steps + Size{kStepSize} * task.free.view[i + k];
      turn[k] = load(step);
      shift[k] = load(step + 4);
    }
    transpose(turn[0], turn[1], turn[2], turn[3]);
    transpose(shift[0], shift[1], shift[2], shift[3]);
    const Vector3 p{load(task.camera_frame + i), load(task.camera_frame + task.stride + i),
                    load(task.camera_frame + 2 * task.stride + i)};
    const Vector3 turned = cross({turn[0], turn[1], turn[2]}, p);
    const Lanes moved[3] = {turned.x + shift[0], turned.y + shift[1], turned.z + shift[2]};
    for (int t = 0; t < 3; ++t) {
      const double* column = task.coupling + static_cast<Size>(t) * task.stride + i;
      store(batch.at(t, i), load(column) * moved[0] + (load(column + 3 * task.stride) * moved[1] +
                                                       load(column + 6 * task.stride) * moved[2]));
    }
  }
}

double back_substitute(const Task& task) {
  double predicted = 0;
  for (Index begin = task.point_begin; begin < task.point_end;) {
    const Index end = batch_end(task, begin);
    const Batch batch{task.scratch, task.scratch_stride, task.ranges[begin].free_begin};
    couple(task, task.ranges[end - 1].free_end, batch);
    for (; begin < end; ++begin) {
      const PointRange& range = task.ranges[begin];
      const double* state = task.point_states + Size{kPointStateSize} * begin;
      double y[3] = {state[6], state[7], state[8]};
      for (Size i = range.free_begin; i < range.free_end; ++i) {
        for (int t = 0; t < 3; ++t) y[t] -= *batch.at(t, i);
      }
      const double step[3] = {state[0] * y[0] + (state[1] * y[1] + state[3] * y[2]),
                              state[2] * y[1] + state[4] * y[2], state[5] * y[2]};
      const double* from = task.points + Size{kPointSize} * begin;
      double* to = task.moved_points + Size{kPointSize} * begin;
      for (int k = 0; k < 3; ++k) {
        to[k] = from[k] + step[k];
        predicted += step[k] * (state[12 + k] * step[k] + state[9 + k]);
      }
      to[3] = 0;
    }
  }
  return predicted;
}

}  // namespace
}  // namespace orbslam::bundle_kernels
