// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/global_bundle_adjustment.hpp"

#include <vector>

namespace orbslam {
namespace {

/// Without observations nothing is estimated, so nothing must be written: somebody else may move
/// such a keyframe meanwhile.
void fix_unobserved(BundleProblem& problem) {
  std::vector<bool> observed(problem.cameras.size(), false);
  for (const BundleProblem::Observation& o : problem.observations) observed[o.camera] = true;
  for (std::size_t i = 0; i < observed.size(); ++i) {
    if (!observed[i]) problem.cameras[i].fixed = true;
  }
}

}  // namespace

GatheredBundle gather_global_bundle(const Map& map) {
  const auto lock = map.read_lock();
  GatheredBundle bundle(map);
  map.for_each_keyframe(
      [&](const KeyFrame& keyframe) { bundle.add_camera(keyframe, keyframe.id.value == 0); });
  map.for_each_point([&](const MapPoint& point) {
    if (!point.observations.empty()) bundle.add_point(point, map);
  });
  fix_unobserved(bundle.problem);
  return bundle;
}

BundleSummary solve_global_bundle(GatheredBundle& bundle, const GlobalBundleOptions& options,
                                  const std::atomic<bool>* abort, int n_threads) {
  BundleOptions solver;
  solver.robust_iterations = options.iterations;
  solver.final_iterations = 0;
  solver.robust = options.robust;
  solver.n_threads = n_threads;
  return solve_bundle(bundle.problem, solver, abort);
}

GlobalBundleResult global_bundle_adjustment(Map& map, const GlobalBundleOptions& options,
                                            const std::atomic<bool>* abort, int n_threads) {
  GlobalBundleResult result;
  GatheredBundle bundle = gather_global_bundle(map);
  result.n_keyframes = static_cast<int>(bundle.keyframes.size());
  result.n_points = static_cast<int>(bundle.points.size());
  result.n_observations = static_cast<int>(bundle.problem.observations.size());
  result.summary = solve_global_bundle(bundle, options, abort, n_threads);
  if (result.summary.aborted || result.summary.iterations == 0) return result;

  const auto lock = map.write_lock();
  if (map.epoch() != bundle.epoch) return result;
  write_back(bundle, map);
  map.count_big_change();
  result.committed = true;
  return result;
}

}  // namespace orbslam
