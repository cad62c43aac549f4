// SPDX-License-Identifier: BSD-3-Clause
#include "camera/lens.hpp"

#include <Eigen/LU>
#include <algorithm>

#include "camera/bend.hpp"

namespace orbslam {
namespace {

// Enough for the lenses of the field, and a fixed number keeps the result reproducible.
constexpr int kFixedPointSteps = 5;

constexpr int kMostNewtonSteps = 30;
constexpr int kMostHalvings = 10;           // of a Newton step that goes too far
constexpr double kNewtonTolerance = 1e-10;  // of the residual at unit depth

}  // namespace

Lens::Lens(const Distortion& coefficients)
    : coefficients_(coefficients),
      distorts_(std::any_of(coefficients.begin(), coefficients.end(),
                            [](double coefficient) { return coefficient != 0; })),
      rational_(std::any_of(coefficients.begin() + 5, coefficients.end(),
                            [](double coefficient) { return coefficient != 0; })) {}

Eigen::Vector2d Lens::bent(const Eigen::Vector2d& straight) const {
  return bend(coefficients_, straight).at;
}

Eigen::Vector2d Lens::straight(const Eigen::Vector2d& bent) const {
  return rational_ ? straight_by_newton(bent) : straight_by_fixed_point(bent);
}

// What a point was moved from is the fixed point of the step below, and OpenCV searches it in the
// same way: the operations stand in the same order, so that coordinates are those of its
// undistortPoints, to the bit.
Eigen::Vector2d Lens::straight_by_fixed_point(const Eigen::Vector2d& bent) const {
  const auto [k1, k2, p1, p2, k3, k4, k5, k6] = coefficients_;
  double x = bent.x(), y = bent.y();
  for (int step = 0; step < kFixedPointSteps; ++step) {
    const double r2 = x * x + y * y;
    const double inverse_radial = 1 / (1 + ((k3 * r2 + k2) * r2 + k1) * r2);
    if (inverse_radial < 0) return bent;  // the model folds the image over out there
    const double tangential_x = 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
    const double tangential_y = p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
    x = (bent.x() - tangential_x) * inverse_radial;
    y = (bent.y() - tangential_y) * inverse_radial;
  }
  return {x, y};
}

// Begins at the bent point; a step is halved until it comes nearer.
Eigen::Vector2d Lens::straight_by_newton(const Eigen::Vector2d& bent) const {
  Eigen::Vector2d point = bent;
  Bent there = bend(coefficients_, point);
  for (int steps = 0; steps < kMostNewtonSteps; ++steps) {
    const Eigen::Vector2d residual = there.at - bent;
    if (!(there.J.determinant() > 0)) return bent;  // folded over
    if (residual.norm() < kNewtonTolerance) return point;
    Eigen::Vector2d step = there.J.inverse() * residual;
    int halvings = 0;
    for (; halvings < kMostHalvings; ++halvings, step *= 0.5) {
      const Bent next = bend(coefficients_, point - step);
      if (!((next.at - bent).norm() < residual.norm())) continue;
      point -= step;
      there = next;
      break;
    }
    if (halvings == kMostHalvings) return bent;
  }
  return bent;
}

}  // namespace orbslam
