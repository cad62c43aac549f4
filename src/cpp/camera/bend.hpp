// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>

namespace orbslam {

/// OpenCV's coefficients k1, k2, p1, p2, k3, and k4, k5, k6 of the rational model; zeros: unused.
using Distortion = std::array<double, 8>;

/// The point after distortion, and its derivative by the point.
struct Bent {
  Eigen::Vector2d at;
  Eigen::Matrix2d J;
};

// D. C. Brown, "Close-range camera calibration", 1971: the lens moves the point (x, y) of the
// pinhole, at unit depth, to (x, y) * radial + tangential. The radial factor is a polynomial of the
// squared radius; in the rational model (D. Claus and A. Fitzgibbon, "A rational function lens
// distortion model for general cameras", 2005) a quotient of two.
inline Bent bend(const Distortion& coefficients, const Eigen::Vector2d& straight) {
  const auto [k1, k2, p1, p2, k3, k4, k5, k6] = coefficients;
  const double x = straight.x(), y = straight.y(), r2 = x * x + y * y;
  const double numerator = 1 + ((k3 * r2 + k2) * r2 + k1) * r2;
  const double denominator = 1 + ((k6 * r2 + k5) * r2 + k4) * r2;
  const double radial = numerator / denominator;
  const double numerator_by_r2 = (3 * k3 * r2 + 2 * k2) * r2 + k1;
  const double denominator_by_r2 = (3 * k6 * r2 + 2 * k5) * r2 + k4;
  const double radial_by_r2 = (numerator_by_r2 - radial * denominator_by_r2) / denominator;
  const double across = 2 * x * y * radial_by_r2 + 2 * p1 * x + 2 * p2 * y;
  Bent bent;
  bent.at << x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
      y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
  bent.J << radial + 2 * x * x * radial_by_r2 + 2 * p1 * y + 6 * p2 * x, across,  //
      across, radial + 2 * y * y * radial_by_r2 + 6 * p1 * y + 2 * p2 * x;
  return bent;
}

}  // namespace orbslam
