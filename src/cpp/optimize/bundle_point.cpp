// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/bundle_point.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace orbslam {
namespace {

/// Below this, a hundred times as far as at the start, a point counts as infinitely far and moves
/// only across its ray. Its depth is not determined, so steps along the ray would never end.
constexpr double kInfinity = -2.5;

/// Inverse depth relative to that at the start, and its derivative: 1 + r, limited so that it stays
/// positive.
struct InverseDepth {
  double value, derivative;
};

InverseDepth inverse_depth(double r) {
  if (r > -0.5) return {1 + r, 1};
  const double value = 0.5 * std::exp(1 + 2 * std::max(r, kInfinity));
  return {value, r > kInfinity ? 2 * value : 0};
}

}  // namespace

BundlePoint::BundlePoint(const Eigen::Vector3d& place, const Eigen::Vector3d& start)
    : place_(place) {
  Eigen::Vector3d ray = start - place;
  if (!(ray.squaredNorm() > 0)) {
    ray = Eigen::Vector3d::UnitZ();
    place_ = start - ray;
  }
  Eigen::Index smallest = 0;
  ray.cwiseAbs().minCoeff(&smallest);
  // As long as the ray, so that all three parameters are small numbers of the same kind.
  axes_.col(0) = ray.cross(Eigen::Vector3d::Unit(smallest)).normalized() * ray.norm();
  axes_.col(1) = ray.normalized().cross(axes_.col(0));
  axes_.col(2) = ray;
  const double origin[kParameters] = {};
  move(origin);
}

void BundlePoint::move(const double* parameters) {
  const InverseDepth inverse = inverse_depth(parameters[2]);
  const double depth = 1 / inverse.value;
  const Eigen::Vector3d ray =
      axes_.col(2) + parameters[0] * axes_.col(0) + parameters[1] * axes_.col(1);
  position_ = place_ + depth * ray;
  jacobian_.col(0) = depth * axes_.col(0);
  jacobian_.col(1) = depth * axes_.col(1);
  jacobian_.col(2) = (-depth * depth * inverse.derivative) * ray;
}

}  // namespace orbslam
