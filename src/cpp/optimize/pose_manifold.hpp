// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ceres/manifold.h>

#include "base/pose.hpp"

namespace orbslam {

/// A pose as Ceres sees it: quaternion (x, y, z, w), then translation; tangent (rotation,
/// translation) acting on the left, Plus(x, d) = exp(d) * x.
///
/// Convention for every cost function on such a block: the Jacobian's first six columns are the
/// derivatives in the *tangent* space and the seventh is zero. PlusJacobian is [I6; 0] to match,
/// which is exact for the solver but useless to automatic differentiation.
class PoseManifold final : public ceres::Manifold {
 public:
  static constexpr int kAmbientSize = 7;
  static constexpr int kTangentSize = 6;

  int AmbientSize() const override { return kAmbientSize; }
  int TangentSize() const override { return kTangentSize; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  /// log(y * x^-1).
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

Pose pose_from_block(const double* block);
void pose_to_block(const Pose& pose, double* block);

}  // namespace orbslam
