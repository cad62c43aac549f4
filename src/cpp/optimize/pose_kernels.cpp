// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/pose_kernels.hpp"

#include <cmath>
#include <cstring>
#include <limits>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace orbslam::pose_kernels {
namespace {

// Two doubles: the vector width of every 64-bit baseline, so there is one version only and the
// bytes of a result do not depend on the processor.
using Lanes = double __attribute__((vector_size(16)));
using Mask = decltype(Lanes{} < Lanes{});

Lanes both(double value) { return Lanes{value, value}; }

Lanes load(const std::vector<double>& values, std::size_t i) {
  Lanes lanes;
  std::memcpy(&lanes, values.data() + i, sizeof(lanes));
  return lanes;
}

Lanes root(Lanes q) {
#if defined(__SSE2__)
  return _mm_sqrt_pd(q);  // the compiler would keep std::sqrt scalar because of errno
#else
  return Lanes{std::sqrt(q[0]), std::sqrt(q[1])};
#endif
}

Lanes select(Mask mask, Lanes yes) {
  return reinterpret_cast<Lanes>(mask & reinterpret_cast<Mask>(yes));
}

double sum(Lanes lanes) { return lanes[0] + lanes[1]; }

struct Sums {
  // Lower triangle of H, row by row, and the right-hand side.
  std::array<Lanes, 21> h{};
  std::array<Lanes, 6> b{};
};

/// Adds weight * J^T J and -weight * J^T e. Entries named in `Zero` are known to be zero.
template <int Zero>
void add_row(Sums& sums, const std::array<Lanes, 6>& jacobian, Lanes weight, Lanes error) {
  int k = 0;
  for (int row = 0; row < 6; ++row) {
    if (row == Zero) {
      k += row + 1;
      continue;
    }
    const auto r = static_cast<std::size_t>(row);
    const Lanes weighted = weight * jacobian[r];
    sums.b[r] -= weighted * error;
    for (int column = 0; column <= row; ++column, ++k) {
      if (column == Zero) continue;
      sums.h[static_cast<std::size_t>(k)] += weighted * jacobian[static_cast<std::size_t>(column)];
    }
  }
}

/// Adds the rows u, v and, with depth, right u of points at (x, y) on the normalised image plane.
template <bool kStereo>
inline void add_points(Sums& sums, Lanes x, Lanes y, Lanes inverse_z, Lanes base,
                       const std::array<Lanes, 3>& errors, Lanes weight_u, Lanes weight_v) {
  const Lanes one = both(1.0), xy = x * y;
  const std::array<Lanes, 6> row_u{xy, -(one + x * x), y, -inverse_z, Lanes{}, x * inverse_z};
  const std::array<Lanes, 6> row_v{one + y * y, -xy, -x, Lanes{}, -inverse_z, y * inverse_z};
  add_row<4>(sums, row_u, weight_u, errors[0]);
  add_row<3>(sums, row_v, weight_v, errors[1]);
  if constexpr (kStereo) {
    const Lanes beta = base * inverse_z;
    const std::array<Lanes, 6> row_right{
        row_u[0] - beta * y,        row_u[1] + beta * x, y, -inverse_z, Lanes{},
        row_u[5] - beta * inverse_z};
    add_row<4>(sums, row_right, weight_u, errors[2]);
  }
}

/// The loops over a group work on the normalised image plane: every residual is in units of the
/// focal length of its row, which moves into the weight of the row.
template <bool kStereo, bool kRobust, bool kSystem>
double accumulate(const Group& group, const Projection& projection, const Pose& T_cw, double huber,
                  Sums* out) {
  const Eigen::Matrix3d R = T_cw.rotation_matrix();
  const Eigen::Vector3d t = T_cw.translation();
  const Pinhole& k = projection.pinhole;
  const Lanes inverse_fx = both(1.0 / k.fx), inverse_fy = both(1.0 / k.fy);
  const Lanes cx = both(k.cx), cy = both(k.cy);
  const Lanes fx2 = both(k.fx * k.fx), fy2 = both(k.fy * k.fy);
  const Lanes base = both(projection.bf / k.fx);  // metres
  const Lanes huber2 = both(huber * huber), width = both(huber), one = both(1.0);

  Sums sums;
  Lanes cost{};
  for (std::size_t i = 0; i < group.x.size(); i += Group::kLanes) {
    const Lanes xw = load(group.x, i), yw = load(group.y, i), zw = load(group.z, i);
    const Lanes xc = R(0, 0) * xw + R(0, 1) * yw + R(0, 2) * zw + t.x();
    const Lanes yc = R(1, 0) * xw + R(1, 1) * yw + R(1, 2) * zw + t.y();
    const Lanes zc = R(2, 0) * xw + R(2, 1) * yw + R(2, 2) * zw + t.z();
    const Mask usable = zc * zc > both(kTinyDepth * kTinyDepth);
    const Lanes inverse_z = select(usable, one / zc);
    const Lanes weight = select(usable, load(group.weight, i));
    const Lanes x = xc * inverse_z, y = yc * inverse_z;

    const Lanes error_u = (load(group.u, i) - cx) * inverse_fx - x;
    const Lanes error_v = (load(group.v, i) - cy) * inverse_fy - y;
    Lanes error_r{};
    Lanes weight_u = weight * fx2, weight_v = weight * fy2;
    Lanes q = weight_u * error_u * error_u + weight_v * error_v * error_v;
    if constexpr (kStereo) {
      error_r = (load(group.right_u, i) - cx) * inverse_fx - x + base * inverse_z;
      q += weight_u * error_r * error_r;
    }
    if constexpr (kRobust) {
      const Mask inside = q <= huber2;
      const Lanes distance = root(q);
      cost += inside ? q : 2.0 * width * distance - huber2;
      const Lanes scale = inside ? one : width / distance;
      weight_u *= scale;
      weight_v *= scale;
    } else {
      cost += q;
    }
    if constexpr (kSystem) {
      add_points<kStereo>(sums, x, y, inverse_z, base, {error_u, error_v, error_r}, weight_u,
                          weight_v);
    }
  }
  if constexpr (kSystem) *out = sums;
  return sum(cost);
}

template <bool kStereo>
double dispatch(const Group& group, const Projection& projection, const Pose& T_cw, double huber,
                NormalEquations* equations) {
  if (group.x.empty()) return 0;
  if (equations == nullptr) {
    return huber > 0 ? accumulate<kStereo, true, false>(group, projection, T_cw, huber, nullptr)
                     : accumulate<kStereo, false, false>(group, projection, T_cw, huber, nullptr);
  }
  Sums sums;
  const double cost = huber > 0
                          ? accumulate<kStereo, true, true>(group, projection, T_cw, huber, &sums)
                          : accumulate<kStereo, false, true>(group, projection, T_cw, huber, &sums);
  std::size_t k = 0;
  for (int row = 0; row < 6; ++row) {
    equations->b(row) += sum(sums.b[static_cast<std::size_t>(row)]);
    for (int column = 0; column <= row; ++column, ++k) {
      const double value = sum(sums.h[k]);
      equations->H(row, column) += value;
      if (column != row) equations->H(column, row) += value;
    }
  }
  return cost;
}

}  // namespace

void Group::clear() {
  for (auto* values : {&x, &y, &z, &u, &v, &right_u, &inverse_sigma2, &weight}) values->clear();
  slot.clear();
}

void Group::push_back(const Eigen::Vector3d& position, double u_px, double v_px, double right_u_px,
                      double inverse_variance, std::size_t caller_slot) {
  x.push_back(position.x());
  y.push_back(position.y());
  z.push_back(position.z());
  u.push_back(u_px);
  v.push_back(v_px);
  right_u.push_back(right_u_px);
  inverse_sigma2.push_back(inverse_variance);
  weight.push_back(inverse_variance);
  slot.push_back(caller_slot);
}

void Group::pad() {
  while (x.size() % kLanes != 0) {
    for (auto* values : {&x, &y, &z, &u, &v, &right_u, &inverse_sigma2}) {
      values->push_back(values->back());
    }
    weight.push_back(0);
  }
}

double accumulate_mono(const Group& group, const Projection& projection, const Pose& T_cw,
                       double huber, NormalEquations* equations) {
  return dispatch<false>(group, projection, T_cw, huber, equations);
}

double accumulate_stereo(const Group& group, const Projection& projection, const Pose& T_cw,
                         double huber, NormalEquations* equations) {
  return dispatch<true>(group, projection, T_cw, huber, equations);
}

double chi2(const Group& group, std::size_t i, bool stereo, const Projection& projection,
            const Eigen::Matrix3d& R_cw, const Eigen::Vector3d& t_cw) {
  const Eigen::Vector3d p = R_cw * Eigen::Vector3d(group.x[i], group.y[i], group.z[i]) + t_cw;
  if (!(p.z() > kTinyDepth)) return std::numeric_limits<double>::infinity();
  const Eigen::Vector2d pixel = projection.pinhole.project(p);
  const double error_u = group.u[i] - pixel.x(), error_v = group.v[i] - pixel.y();
  double squared = error_u * error_u + error_v * error_v;
  if (stereo) {
    const double error_r = group.right_u[i] - (pixel.x() - projection.bf / p.z());
    squared += error_r * error_r;
  }
  return group.inverse_sigma2[i] * squared;
}

}  // namespace orbslam::pose_kernels
