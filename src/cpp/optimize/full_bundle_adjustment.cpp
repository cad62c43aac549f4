// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/full_bundle_adjustment.hpp"

#include <algorithm>
#include <cmath>

namespace orbslam {
namespace {

/// Small maps have just begun. Their points come from two views, and coordinates suit them as well
/// as inverse depths.
constexpr std::size_t kManyKeyframes = 30;

bool is_finite(const BundleProblem& problem) {
  const auto& cameras = problem.cameras;
  const auto& points = problem.points;
  return std::all_of(cameras.begin(), cameras.end(),
                     [](const auto& camera) {
                       return camera.T_cw.rotation().coeffs().allFinite() &&
                              camera.T_cw.translation().allFinite();
                     }) &&
         std::all_of(points.begin(), points.end(),
                     [](const Eigen::Vector3d& point) { return point.allFinite(); });
}

}  // namespace

BundleSummary solve_full_bundle(GatheredBundle& bundle, const FullBundleOptions& options,
                                const std::atomic<bool>* abort, int n_threads) {
  BundleOptions solver;
  solver.robust_iterations = options.iterations;
  solver.final_iterations = 0;
  solver.robust = options.robust;
  solver.n_threads = n_threads;
  solver.inverse_depth = bundle.keyframes.size() > kManyKeyframes;
  solver.max_seconds = options.max_seconds;
  solver.solver = BundleSolver::kCeres;  // the keyframes of a map hardly ever all share points
  const BundleSummary summary = solve_bundle(bundle.problem, solver, abort);
  // A comparison with NaN is false.
  bundle.solved = !summary.aborted && summary.iterations > 0 &&
                  summary.final_cost <= summary.initial_cost && is_finite(bundle.problem);
  return summary;
}

}  // namespace orbslam
