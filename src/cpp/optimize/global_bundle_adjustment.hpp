// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>

#include "map/map.hpp"
#include "optimize/bundle_adjustment.hpp"
#include "optimize/bundle_gather.hpp"

namespace orbslam {

struct GlobalBundleOptions {
  int iterations = 10;  ///< accepted steps at most
  bool robust = true;   ///< Huber kernel on all observations
};

struct GlobalBundleResult {
  int n_keyframes = 0;  ///< cameras, fixed ones included
  int n_points = 0, n_observations = 0;
  bool committed = false;  ///< the map was changed
  BundleSummary summary;
};

/// Spec 16, section 4: refines all keyframes, unpublished ones included, and all points; keyframe 0
/// is fixed and no observation is erased. Gathers under the read lock, solves without a lock, and
/// commits in one write section, which counts as a big change; what has died meanwhile is left
/// out. After an abort, or when the map was cleared meanwhile, the map stays as it was.
GlobalBundleResult global_bundle_adjustment(Map& map, const GlobalBundleOptions& options,
                                            const std::atomic<bool>* abort, int n_threads = 1);

// Its parts, for those that put something between.

/// All keyframes and points of the map. Keyframes without observations are fixed. Takes the read
/// lock.
GatheredBundle gather_global_bundle(const Map& map);
/// Solves a gathered bundle in place. The parameters are of no use when the summary says aborted.
BundleSummary solve_global_bundle(GatheredBundle& bundle, const GlobalBundleOptions& options,
                                  const std::atomic<bool>* abort, int n_threads);

}  // namespace orbslam
