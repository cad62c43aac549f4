// SPDX-License-Identifier: BSD-3-Clause
#include "loops/upright.hpp"

#include <cmath>

namespace orbslam {
namespace {

// Largest difference of roll and pitch [rad]; an IMU knows them to less than 0.03 where it starts.
constexpr double kTilt = 0.05;

}  // namespace

bool is_upright(const Map& map, MapIndex which) {
  const auto lock = map.read_lock();
  return map.is_upright(which);
}

std::optional<Similarity> upright_correction(const Pose& T_cw, const Similarity& S_cw) {
  // From the world of the loop to that of the camera, by their rotations: a yaw if both are right.
  const Eigen::Quaterniond between = T_cw.rotation().conjugate() * S_cw.rotation();
  const double angle = 2 * std::atan2(between.z(), between.w());
  const Eigen::Quaterniond yaw(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
  if ((between * yaw.conjugate()).vec().norm() > std::sin(kTilt / 2)) return std::nullopt;
  const Eigen::Quaterniond rotation = (T_cw.rotation() * yaw).normalized();
  // The centre -R^T t / s of the camera stays.
  const Eigen::Vector3d t = rotation * (S_cw.rotation().conjugate() * S_cw.translation());
  return S_cw.inverse() * Similarity(S_cw.scale(), rotation, t);
}

}  // namespace orbslam
