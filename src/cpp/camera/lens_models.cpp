// SPDX-License-Identifier: BSD-3-Clause
#include "camera/lens_models.hpp"

#include <algorithm>

#include "camera/increasing.hpp"

namespace orbslam::lens_models {

KannalaBrandtLens::KannalaBrandtLens(const Pinhole& plane, const std::array<double, 4>& k)
    : plane_(plane), k_(k) {
  const double fold = smallest_positive_root({1, 3 * k[0], 5 * k[1], 7 * k[2], 9 * k[3]});
  largest_theta_ = std::min(kPi, std::sqrt(fold));
}

bool KannalaBrandtLens::unproject(const Eigen::Vector2d& uv, Eigen::Vector3d& ray) const {
  const Eigen::Vector2d m = plane_.to_plane(uv);
  const double distance = m.norm();
  double theta = 0;
  const auto function = [this](double at) {
    return ValueAndSlope{radius(at).value, radius(at).slope};
  };
  if (distance > 0 && !invert_increasing(function, distance, largest_theta_, theta)) return false;
  if (!(distance >= 0)) return false;
  ray = ray_at(m, distance, theta);
  return true;
}

}  // namespace orbslam::lens_models
