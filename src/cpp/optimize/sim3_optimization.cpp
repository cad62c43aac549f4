// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/sim3_optimization.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "optimize/gates.hpp"
#include "optimize/sim3_residuals.hpp"

namespace orbslam {
namespace {

using sim3_residuals::Residual;

constexpr int kFirstIterations = 5;
constexpr int kMoreIterations = 10;  // after outliers were found
constexpr int kTrials = 10;
constexpr int kMinMatches = 10;
constexpr double kMaxLogScaleStep = 100;  // beyond, the scale leaves the range of numbers

/// Normal equations H x = b and the robustified sum of squares they belong to.
struct System {
  Matrix7d H = Matrix7d::Zero();
  Vector7d b = Vector7d::Zero();
  double cost = 0;
};

class Refinement {
 public:
  Refinement(const Camera& camera_1, const Camera& camera_2,
             const std::vector<SimilarityMatch>& matches, const SimilarityOptions& options,
             std::vector<std::uint8_t>& outlier)
      : camera_1_(camera_1),
        camera_2_(camera_2),
        matches_(matches),
        options_(options),
        width_(std::sqrt(options.max_chi2)),
        outlier_(outlier) {}

  /// Levenberg-Marquardt (gates.hpp) on the matches that are not outliers. Ends after
  /// `max_iterations`, after kSmallDecreases small decreases in a row, or when no damping lowers
  /// the cost. Returns the number of iterations.
  int minimise(int max_iterations, Similarity& S_12) const {
    System system = evaluate(S_12);
    if (!std::isfinite(system.cost)) return 0;
    double lambda = kFirstDamping * system.H.diagonal().maxCoeff();
    int small_decreases = 0;
    for (int iteration = 1; iteration <= max_iterations; ++iteration) {
      const double before = system.cost;
      if (!advance(S_12, system, lambda)) return iteration;
      small_decreases = before - system.cost < kSmallDecrease * before ? small_decreases + 1 : 0;
      if (small_decreases >= kSmallDecreases) return iteration;
    }
    return max_iterations;
  }

  /// Turns matches that fail a gate into outliers; those that are stay so. Returns the inliers.
  int judge(const Similarity& S_12) const {
    int n_inliers = 0;
    for (std::size_t i = 0; i < matches_.size(); ++i) {
      if (outlier_[i]) continue;
      const bool fits =
          passes(sim3_residuals::forward(S_12, camera_1_, matches_[i])) &&
          (!matches_[i].mutual || passes(sim3_residuals::inverse(S_12, camera_2_, matches_[i])));
      outlier_[i] = fits ? 0 : 1;
      n_inliers += outlier_[i] ? 0 : 1;
    }
    return n_inliers;
  }

 private:
  bool passes(const std::optional<Residual>& residual) const {
    return residual && residual->depth > 0 && residual->error.squaredNorm() <= options_.max_chi2;
  }

  void add(const std::optional<Residual>& residual, System& system) const {
    if (!residual) return;
    const double q = residual->error.squaredNorm();
    const bool inside = q <= options_.max_chi2;
    const double weight = inside ? 1.0 : width_ / std::sqrt(q);
    system.cost += inside ? q : 2 * width_ * std::sqrt(q) - options_.max_chi2;
    system.H += weight * residual->jacobian.transpose() * residual->jacobian;
    system.b -= weight * residual->jacobian.transpose() * residual->error;
  }

  System evaluate(const Similarity& S_12) const {
    System system;
    for (std::size_t i = 0; i < matches_.size(); ++i) {
      if (outlier_[i]) continue;
      add(sim3_residuals::forward(S_12, camera_1_, matches_[i]), system);
      if (!matches_[i].mutual) continue;
      add(sim3_residuals::inverse(S_12, camera_2_, matches_[i]), system);
    }
    if (options_.fix_scale) {
      // Decouples sigma from the rest; its right-hand side is zero, so it does not change.
      system.H.row(6).setZero();
      system.H.col(6).setZero();
      system.b(6) = 0;
    }
    return system;
  }

  /// One iteration's trials: looks for a damping with which the cost falls.
  bool advance(Similarity& S_12, System& system, double& lambda) const {
    double growth = 2;
    for (int trial = 0; trial < kTrials; ++trial) {
      Matrix7d damped = system.H;
      damped.diagonal().array() += lambda;
      const Eigen::LLT<Matrix7d> factor(damped);
      double gain = -1;
      if (factor.info() == Eigen::Success) {
        const Vector7d step = factor.solve(system.b);
        if (step.allFinite() && std::abs(step(6)) < kMaxLogScaleStep) {
          const Similarity candidate = Similarity::exp(step) * S_12;
          const System next = evaluate(candidate);
          const double predicted = step.dot(lambda * step + system.b) + kGainOffset;
          if (std::isfinite(next.cost)) gain = (system.cost - next.cost) / predicted;
          if (gain > 0) {
            S_12 = candidate;
            system = next;
            const double cubed = std::pow(2 * gain - 1, 3);
            lambda *= std::max(kLeastDampingFactor, std::min(kMostDampingFactor, 1 - cubed));
            return true;
          }
        }
      }
      if (gain == 0) return false;
      lambda *= growth;
      growth *= 2;
      if (!std::isfinite(lambda)) return false;
    }
    return false;
  }

  const Camera& camera_1_;
  const Camera& camera_2_;
  const std::vector<SimilarityMatch>& matches_;
  const SimilarityOptions& options_;
  double width_;
  std::vector<std::uint8_t>& outlier_;
};

bool usable(const SimilarityMatch& match) {
  const bool forward = match.point_2.allFinite() && match.pixel_1.allFinite() &&
                       match.inverse_sigma2_1 > 0 && std::isfinite(match.inverse_sigma2_1);
  const bool inverse = match.point_1.allFinite() && match.pixel_2.allFinite() &&
                       match.inverse_sigma2_2 > 0 && std::isfinite(match.inverse_sigma2_2);
  return forward && (inverse || !match.mutual);
}

}  // namespace

SimilarityEstimate optimize_similarity(const Similarity& S_12_initial, const Camera& camera_1,
                                       const Camera& camera_2,
                                       const std::vector<SimilarityMatch>& matches,
                                       const SimilarityOptions& options) {
  if (!(options.max_chi2 > 0)) {
    throw std::invalid_argument("optimize_similarity: max_chi2 must be positive");
  }
  SimilarityEstimate estimate;
  estimate.S_12 = S_12_initial;
  estimate.outlier.resize(matches.size());
  std::transform(matches.begin(), matches.end(), estimate.outlier.begin(),
                 [](const SimilarityMatch& match) { return usable(match) ? 0 : 1; });
  const auto used =
      static_cast<int>(std::count(estimate.outlier.begin(), estimate.outlier.end(), 0));

  const Refinement refinement(camera_1, camera_2, matches, options, estimate.outlier);
  Similarity S_12 = S_12_initial;
  estimate.iterations = refinement.minimise(kFirstIterations, S_12);
  const int left = refinement.judge(S_12);
  if (left < kMinMatches) return estimate;
  estimate.iterations +=
      refinement.minimise(left < used ? kMoreIterations : kFirstIterations, S_12);
  estimate.n_inliers = refinement.judge(S_12);
  estimate.S_12 = S_12;
  return estimate;
}

}  // namespace orbslam
