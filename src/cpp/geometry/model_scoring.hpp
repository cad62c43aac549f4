// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "geometry/point_pairs.hpp"

namespace orbslam {

/// Squared errors of all pairs under one model, in both directions [pixels^2]; reused.
struct PairErrors {
  Eigen::ArrayXd in_1, in_2;
};

/// Score of one direction of a pair: `credit` minus its squared error, if that is below the limit.
/// See docs/method/start.md#homography-or-fundamental-matrix.
struct ErrorGate {
  double limit = 0;
  double credit = 0;
};

/// Sum of the credits. An error that is not a number counts as too large.
inline double score_errors(const PairErrors& errors, double inverse_sigma2, ErrorGate gate) {
  double score = 0;
  for (Eigen::Index i = 0; i < errors.in_1.size(); ++i) {
    const double chi_1 = errors.in_1[i] * inverse_sigma2, chi_2 = errors.in_2[i] * inverse_sigma2;
    score += chi_1 <= gate.limit ? gate.credit - chi_1 : 0.0;
    score += chi_2 <= gate.limit ? gate.credit - chi_2 : 0.0;
  }
  return score;
}

/// Flags and counts the pairs whose errors are within the limit in both directions.
inline void mark_inliers(const PairErrors& errors, double inverse_sigma2, ErrorGate gate,
                         ScoredModel& model) {
  const auto fits = [&](double error) { return error * inverse_sigma2 <= gate.limit; };
  model.inliers.assign(static_cast<std::size_t>(errors.in_1.size()), 0);
  model.n_inliers = 0;
  for (std::size_t i = 0; i < model.inliers.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    if (!fits(errors.in_1[k]) || !fits(errors.in_2[k])) continue;
    model.inliers[i] = 1;
    ++model.n_inliers;
  }
}

/// Fits a model to every sample and keeps the first one with the highest score.
template <class Fit, class Measure>
ScoredModel best_model(const std::vector<EightPairs>& samples, double sigma, ErrorGate gate,
                       Fit fit, Measure measure) {
  const double inverse_sigma2 = 1.0 / (sigma * sigma);
  PairErrors errors;
  ScoredModel best;
  for (const EightPairs& sample : samples) {
    const Eigen::Matrix3d matrix = fit(sample);
    if (!matrix.allFinite()) continue;
    measure(matrix, errors);
    const double score = score_errors(errors, inverse_sigma2, gate);
    if (!(score > best.score)) continue;
    best.matrix = matrix;
    best.score = score;
  }
  if (best.score > 0) {
    measure(best.matrix, errors);
    mark_inliers(errors, inverse_sigma2, gate, best);
  }
  return best;
}

}  // namespace orbslam
