// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/bundle_adjustment.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "base/errors.hpp"
#include "optimize/bundle_minimiser.hpp"
#include "optimize/gates.hpp"

namespace orbslam {
namespace {

using Observation = BundleProblem::Observation;

void check_indices(const BundleProblem& problem) {
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    const Observation& o = problem.observations[i];
    if (o.camera >= problem.cameras.size() || o.point >= problem.points.size()) {
      throw StateError("solve_bundle: observation " + std::to_string(i) + " names camera " +
                       std::to_string(o.camera) + " and point " + std::to_string(o.point) +
                       ", but there are " + std::to_string(problem.cameras.size()) + " and " +
                       std::to_string(problem.points.size()));
    }
  }
}

/// Squared whitened residual of every observation; infinite when the camera cannot see its
/// point or a number is not finite.
std::vector<double> judge(const BundleProblem& problem) {
  std::vector<Eigen::Matrix3d> rotations;
  rotations.reserve(problem.cameras.size());
  for (const auto& camera : problem.cameras) rotations.push_back(camera.T_cw.rotation_matrix());
  std::vector<double> chi2;
  chi2.reserve(problem.observations.size());
  for (const Observation& o : problem.observations) {
    const BundleProblem::Camera& camera = problem.cameras[o.camera];
    const Eigen::Vector3d p =
        rotations[o.camera] * problem.points[o.point] + camera.T_cw.translation();
    Eigen::Vector2d error;
    if (!camera.model->error(p, o.u, o.v, error)) {
      chi2.push_back(std::numeric_limits<double>::infinity());
      continue;
    }
    double squared = error.squaredNorm();
    if (o.has_depth) {
      const double right = camera.model->right_error(p, error, o.u, o.v, o.right_u);
      squared += static_cast<double>(o.right_factor) * (right * right);
    }
    const double whitened = static_cast<double>(o.inverse_sigma2) * squared;
    chi2.push_back(std::isfinite(whitened) ? whitened : std::numeric_limits<double>::infinity());
  }
  return chi2;
}

std::vector<std::uint8_t> usable(const std::vector<double>& chi2) {
  std::vector<std::uint8_t> flags(chi2.size());
  for (std::size_t i = 0; i < flags.size(); ++i) flags[i] = std::isfinite(chi2[i]) ? 1 : 0;
  return flags;
}

std::vector<std::uint8_t> outliers(const BundleProblem& problem, const std::vector<double>& chi2) {
  std::vector<std::uint8_t> flags(chi2.size());
  for (std::size_t i = 0; i < flags.size(); ++i) {
    const double gate = problem.observations[i].has_depth ? kGateStereo : kGateMono;
    flags[i] = chi2[i] <= gate ? 0 : 1;
  }
  return flags;
}

double kernel_cost(double q, double width) {
  return q > width * width ? 2 * width * std::sqrt(q) - width * width : q;
}

/// Sum of squares of the observations that were usable at the start, robustified if the options say
/// so. An observation that is now behind its camera counts with its cost at the start.
double total_cost(const BundleProblem& problem, const std::vector<double>& start,
                  const std::vector<double>& now, bool robust) {
  double sum = 0;
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    if (!std::isfinite(start[i])) continue;
    const double q = std::isfinite(now[i]) ? now[i] : start[i];
    const double width = problem.observations[i].has_depth ? kHuberStereo : kHuberMono;
    sum += robust ? kernel_cost(q, width) : q;
  }
  return sum;
}

/// Both stages.
void minimise(BundleProblem& problem, const BundleOptions& options,
              const std::vector<double>& start, const std::atomic<bool>* abort,
              const TimeLimit* limit, BundleSummary& summary) {
  const auto minimiser =
      options.solver == BundleSolver::kCeres
          ? ceres_minimiser(problem, options, usable(start))
          : block_minimiser(problem, options, usable(start), bundle_kernels::best_kernels());
  const bool two_stages = options.final_iterations > 0;
  BundleStage stage{options.robust_iterations,
                    two_stages ? BundleDamping::kEqual : BundleDamping::kScaled, abort, limit};
  summary.aborted = minimiser->minimise(stage, summary);
  summary.stage_one_done = !summary.aborted && !summary.timed_out;
  if (!summary.stage_one_done || !two_stages) return;
  minimiser->keep_inliers(outliers(problem, judge(problem)));
  stage.iterations = options.final_iterations;
  stage.damping = BundleDamping::kScaled;
  summary.aborted = minimiser->minimise(stage, summary);
}

}  // namespace

BundleSummary solve_bundle(BundleProblem& problem, const BundleOptions& options,
                           const std::atomic<bool>* abort) {
  check_indices(problem);
  if (options.inverse_depth && options.solver != BundleSolver::kCeres) {
    throw StateError("solve_bundle: only the solver of Ceres steps along inverse depths");
  }
  const TimeLimit time_limit(options.max_seconds);
  const TimeLimit* limit = options.max_seconds > 0 ? &time_limit : nullptr;
  BundleSummary summary;
  const std::vector<double> start = judge(problem);
  std::vector<double> now = start;
  summary.initial_cost = total_cost(problem, start, start, options.robust);
  summary.aborted = is_raised(abort);
  if (!summary.aborted) {
    minimise(problem, options, start, abort, limit, summary);
    now = judge(problem);
  }
  summary.final_cost = total_cost(problem, start, now, options.robust);
  summary.outlier = outliers(problem, now);
  return summary;
}

}  // namespace orbslam
