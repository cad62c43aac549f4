// SPDX-License-Identifier: BSD-3-Clause
#include "camera/increasing.hpp"

#include <algorithm>
#include <limits>

namespace orbslam {
namespace {

double value_of(const std::vector<double>& coefficients, double t) {
  double value = 0;
  for (auto c = coefficients.rbegin(); c != coefficients.rend(); ++c) value = value * t + *c;
  return value;
}

double bisect(const std::vector<double>& coefficients, double low, double high) {
  const bool rises = value_of(coefficients, high) > 0;
  for (;;) {
    const double middle = 0.5 * (low + high);
    if (!(middle > low && middle < high)) return low;
    ((value_of(coefficients, middle) > 0) == rises ? high : low) = middle;
  }
}

/// All roots above 0, ascending. Between two roots of its derivative a polynomial is monotonic.
std::vector<double> positive_roots(std::vector<double> coefficients) {
  while (!coefficients.empty() && coefficients.back() == 0) coefficients.pop_back();
  if (coefficients.size() < 2) return {};
  std::vector<double> derivative;
  double bound = 1;  // Cauchy's bound of all roots
  for (std::size_t i = 0; i < coefficients.size(); ++i) {
    if (i > 0) derivative.push_back(static_cast<double>(i) * coefficients[i]);
    bound = std::max(bound, 1 + std::abs(coefficients[i] / coefficients.back()));
  }
  std::vector<double> limits = positive_roots(derivative);
  limits.push_back(bound);
  std::vector<double> roots;
  double low = 0;
  for (const double high : limits) {
    const double at_low = value_of(coefficients, low), at_high = value_of(coefficients, high);
    if (at_high == 0) {
      roots.push_back(high);
    } else if (at_low != 0 && (at_low > 0) != (at_high > 0)) {
      roots.push_back(bisect(coefficients, low, high));
    }
    low = high;
  }
  return roots;
}

}  // namespace

double smallest_positive_root(std::vector<double> coefficients) {
  const std::vector<double> roots = positive_roots(std::move(coefficients));
  return roots.empty() ? std::numeric_limits<double>::infinity() : roots.front();
}

}  // namespace orbslam
