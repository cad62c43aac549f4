// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "optimize/full_bundle_adjustment.hpp"

namespace orbslam::testing {

struct FullBundleResult {
  int n_keyframes = 0, n_points = 0, n_observations = 0;
  bool committed = false;
  BundleSummary summary;
};

/// The three steps of a full bundle adjustment, right after each other.
inline FullBundleResult full_bundle_adjustment(Map& map, const FullBundleOptions& options,
                                               const std::atomic<bool>* abort) {
  GatheredBundle bundle = gather_full_bundle(map);
  FullBundleResult result;
  result.n_keyframes = static_cast<int>(bundle.keyframes.size());
  result.n_points = static_cast<int>(bundle.points.size());
  result.n_observations = static_cast<int>(bundle.problem.observations.size());
  result.summary = solve_full_bundle(bundle, options, abort, 1);
  result.committed = commit_full_bundle(map, bundle).committed;
  return result;
}

}  // namespace orbslam::testing
