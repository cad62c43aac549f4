// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>

namespace orbslam {

/// OpenCV's coefficients k1, k2, p1, p2, k3, and k4, k5, k6 of the rational model; zeros: unused.
using Distortion = std::array<double, 8>;

/// OpenCV's lens, radial-tangential or (with k4, k5 or k6) rational, on the plane at unit depth.
class Lens {
 public:
  explicit Lens(const Distortion& coefficients);

  /// Any coefficient is not 0.
  bool distorts() const { return distorts_; }
  /// Where the lens shows what a pinhole shows at `straight`.
  Eigen::Vector2d bent(const Eigen::Vector2d& straight) const;
  /// What the lens shows at `bent`; `bent` itself where the model folds over and nothing fits.
  Eigen::Vector2d straight(const Eigen::Vector2d& bent) const;

 private:
  Eigen::Vector2d straight_by_fixed_point(const Eigen::Vector2d& bent) const;
  Eigen::Vector2d straight_by_newton(const Eigen::Vector2d& bent) const;

  Distortion coefficients_;
  bool distorts_ = false, rational_ = false;
};

}  // namespace orbslam
