// SPDX-License-Identifier: BSD-3-Clause
#include "camera/plane_distortion.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "camera/increasing.hpp"

namespace orbslam {
namespace {

constexpr int kMostInverseSteps = 50;
constexpr int kMostInverseHalvings = 30;
constexpr int kOutwardSteps = 16;
// Residuals at unit depth: one ends the steps, the other must be reached.
constexpr double kInverseGoal = 1e-14;
constexpr double kInverseTolerance = 1e-10;

std::vector<double> product(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> c(a.size() + b.size() - 1, 0.0);
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < b.size(); ++j) c[i + j] += a[i] * b[j];
  }
  return c;
}

/// With t = r^2 the radius becomes r N(t) / D(t). It increases while N D + 2 t (N' D - N D') and D
/// are positive.
double largest_r2_of(const Distortion& coefficients) {
  const auto [k1, k2, p1, p2, k3, k4, k5, k6] = coefficients;
  const std::vector<double> n{1, k1, k2, k3}, d{1, k4, k5, k6};
  const std::vector<double> t_n{0, k1, 2 * k2, 3 * k3}, t_d{0, k4, 2 * k5, 3 * k6};  // t N', t D'
  std::vector<double> slope = product(n, d);
  const std::vector<double> first = product(t_n, d), second = product(n, t_d);
  for (std::size_t i = 0; i < slope.size(); ++i) slope[i] += 2 * (first[i] - second[i]);
  return std::min(smallest_positive_root(slope), smallest_positive_root(d));
}

/// The radial part of the distortion at radius r.
ValueAndSlope radius_at(const Distortion& coefficients, double r) {
  const auto [k1, k2, p1, p2, k3, k4, k5, k6] = coefficients;
  const Bent bent = bend({k1, k2, 0, 0, k3, k4, k5, k6}, {r, 0});
  return {bent.at.x(), bent.J(0, 0)};
}

// Radii and directions in which a domain with tangential terms is searched for a second part.
constexpr double kFirstRadius = 0.01, kRadiusStep = 1.02;
constexpr int kRadii = 700;  // the last one is 1e4: 0.006 degrees from the plane z = 0
constexpr int kDirections = 64;

/// The smallest radius, over all directions, at which the distortion becomes one-to-one again.
/// Points beyond it have the same pixels as nearer points.
double second_part(const PlaneDistortion& distortion) {
  double smallest = kFirstRadius * std::pow(kRadiusStep, kRadii);
  for (int i = 0; i < kDirections; ++i) {
    const double phi = 2 * 3.14159265358979323846 * i / kDirections;
    const Eigen::Vector2d direction(std::cos(phi), std::sin(phi));
    double r = kFirstRadius, ended = 0;
    Bent bent;
    for (int step = 0; step < kRadii && r < smallest; ++step, r *= kRadiusStep) {
      if (!distortion.distort(r * direction, bent)) {
        ended = r;
      } else if (ended > 0) {
        smallest = ended;
      }
    }
  }
  return smallest;
}

}  // namespace

PlaneDistortion::PlaneDistortion(const std::array<double, 12>& coefficients)
    : radial_tangential_(), prism_(), has_tangential_(false) {
  std::copy_n(coefficients.begin(), 8, radial_tangential_.begin());
  std::copy_n(coefficients.begin() + 8, 4, prism_.begin());
  largest_r2_ = largest_r2_of(radial_tangential_);
  const auto used = [](double coefficient) { return coefficient != 0; };
  has_tangential_ = used(coefficients[2]) || used(coefficients[3]) ||
                    std::any_of(prism_.begin(), prism_.end(), used);
  if (has_tangential_) {
    const double second = second_part(*this);
    largest_r2_ = std::min(largest_r2_, second * second);
  }
}

// Begins at the solution of the radial part alone. Where strong tangential terms lead astray,
// begins at the axis and follows the point outwards.
bool PlaneDistortion::undistort(const Eigen::Vector2d& bent, Eigen::Vector2d& straight) const {
  // The end itself is excluded: it may be a pole of the rational model.
  const double radius = bent.norm(), end = (1 - 1e-9) * std::sqrt(largest_r2_);
  if (!std::isfinite(radius)) return false;
  straight.setZero();
  if (radius == 0) return true;
  double r = 0;
  const auto function = [this](double at) { return radius_at(radial_tangential_, at); };
  if (invert_increasing(function, radius, end, r)) {
    straight = bent * (r / radius);
    if (approach(bent, straight)) return true;
  }
  if (!has_tangential_) return false;
  straight.setZero();
  for (int step = 1; step <= kOutwardSteps; ++step) {
    if (!approach(bent * (static_cast<double>(step) / kOutwardSteps), straight)) return false;
  }
  return true;
}

// A step is halved until it stays in the domain and lowers the residual.
bool PlaneDistortion::approach(const Eigen::Vector2d& bent, Eigen::Vector2d& straight) const {
  Bent there;
  if (!distort(straight, there)) return false;
  const double size = std::max(1.0, bent.norm());
  for (int steps = 0; steps < kMostInverseSteps; ++steps) {
    const Eigen::Vector2d residual = there.at - bent;
    if (residual.norm() <= kInverseGoal * size) return true;
    Eigen::Vector2d step = there.J.inverse() * residual;
    int halvings = 0;
    for (; halvings < kMostInverseHalvings; ++halvings, step *= 0.5) {
      const Eigen::Vector2d candidate = straight - step;
      Bent next;
      if (!distort(candidate, next) || !((next.at - bent).norm() < residual.norm())) continue;
      straight = candidate;
      there = next;
      break;
    }
    if (halvings == kMostInverseHalvings) break;  // rounding, or nothing fits
  }
  return (there.at - bent).norm() <= kInverseTolerance * size;
}

}  // namespace orbslam
