// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/pose_kernels.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>

#include "optimize/pose_sums.hpp"

namespace orbslam::pose_kernels {
namespace {

pose_sums::Task task_of(const Group& group, const Camera& camera, const Pose& T_cw, double huber) {
  const Pinhole& k = camera.pinhole();
  pose_sums::Task task{group.x.size(),
                       group.x.data(),
                       group.y.data(),
                       group.z.data(),
                       group.u.data(),
                       group.v.data(),
                       group.right_u.data(),
                       group.weight.data(),
                       group.right_factor.data(),
                       !camera.is_pinhole(),
                       {},
                       {},
                       {},
                       k.fx,
                       k.fy,
                       k.cx,
                       k.cy,
                       camera.bf() / k.fx,
                       camera.bf(),
                       huber};
  for (std::size_t entry = 0; entry < group.sight.size(); ++entry) {
    task.sight[entry] = group.sight[entry].data();
  }
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> R = T_cw.rotation_matrix();
  std::copy_n(R.data(), 9, std::begin(task.rotation));
  std::copy_n(T_cw.translation().data(), 3, std::begin(task.translation));
  return task;
}

double accumulate(pose_sums::Accumulate kernel, const Group& group, const Camera& camera,
                  const Pose& T_cw, double huber, NormalEquations* equations) {
  if (group.x.empty()) return 0;
  const pose_sums::Task task = task_of(group, camera, T_cw, huber);
  if (equations == nullptr) return kernel(task, nullptr);
  std::array<double, pose_sums::kSystemSize> system;
  const double cost = kernel(task, system.data());
  std::size_t k = 0;
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column <= row; ++column, ++k) {
      equations->H(row, column) += system[k];
      if (column != row) equations->H(column, row) += system[k];
    }
  }
  for (int row = 0; row < 6; ++row, ++k) equations->b(row) += system[k];
  return cost;
}

const pose_sums::Kernels& kernels() {
  static const pose_sums::Kernels& best = pose_sums::best_kernels();
  return best;
}

}  // namespace

void Group::clear() {
  for (auto* values : {&x, &y, &z, &u, &v, &right_u, &inverse_sigma2, &right_factor, &weight}) {
    values->clear();
  }
  for (auto& values : sight) values.clear();
  slot.clear();
}

void Group::push_back(const Eigen::Vector3d& position, double u_px, double v_px, double right_u_px,
                      double inverse_variance, double right_factor_of_it, std::size_t caller_slot) {
  x.push_back(position.x());
  y.push_back(position.y());
  z.push_back(position.z());
  u.push_back(u_px);
  v.push_back(v_px);
  right_u.push_back(right_u_px);
  inverse_sigma2.push_back(inverse_variance);
  right_factor.push_back(right_factor_of_it);
  weight.push_back(inverse_variance);
  slot.push_back(caller_slot);
}

void Group::pad() {
  while (x.size() % kLanes != 0) {
    for (auto* values : {&x, &y, &z, &u, &v, &right_u, &inverse_sigma2, &right_factor}) {
      values->push_back(values->back());
    }
    for (auto& values : sight) {
      if (!values.empty()) values.push_back(values.back());
    }
    weight.push_back(0);
  }
}

void Group::push_back(const Sight& B) {
  for (std::size_t k = 0; k < sight.size(); ++k) {
    sight[k].push_back(sight_entry(B, k));
  }
}

double accumulate_mono(const Group& group, const Camera& camera, const Pose& T_cw, double huber,
                       NormalEquations* equations) {
  return accumulate(kernels().mono, group, camera, T_cw, huber, equations);
}

double accumulate_stereo(const Group& group, const Camera& camera, const Pose& T_cw, double huber,
                         NormalEquations* equations) {
  return accumulate(kernels().stereo, group, camera, T_cw, huber, equations);
}

double chi2(const Group& group, std::size_t i, bool stereo, const Camera& camera,
            const Eigen::Matrix3d& R_cw, const Eigen::Vector3d& t_cw) {
  const Eigen::Vector3d p = R_cw * Eigen::Vector3d(group.x[i], group.y[i], group.z[i]) + t_cw;
  if (camera.is_flat() && !(p.z() > kTinyDepth)) return std::numeric_limits<double>::infinity();
  Eigen::Vector2d error;
  if (!camera.error(p, group.u[i], group.v[i], error)) {
    return std::numeric_limits<double>::infinity();
  }
  double squared = error.squaredNorm();
  if (stereo) {
    double error_r = 0;
    if (camera.is_flat()) {
      error_r = camera.right_error(p, error, group.u[i], group.v[i], group.right_u[i]);
    } else {  // as right_error() has it, with the sight that is known
      double q[3];
      for (std::size_t row = 0; row < 3; ++row) {
        q[row] = group.sight[3 * row][i] * p.x() + group.sight[3 * row + 1][i] * p.y() +
                 group.sight[3 * row + 2][i] * p.z() + group.sight[9 + row][i];
      }
      error_r = (q[0] - camera.bf()) / q[2] + (group.u[i] - group.right_u[i]);
    }
    squared += group.right_factor[i] * (error_r * error_r);
  }
  return group.inverse_sigma2[i] * squared;
}

}  // namespace orbslam::pose_kernels
