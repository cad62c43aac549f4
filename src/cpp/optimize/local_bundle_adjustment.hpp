// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>

#include "map/map.hpp"
#include "optimize/bundle_adjustment.hpp"

namespace orbslam {

struct LocalBundleResult {
  int n_local_keyframes = 0, n_fixed_keyframes = 0, n_points = 0, n_observations = 0;
  int n_erased = 0;  ///< observations removed as outliers
  bool committed = false;
  BundleSummary summary;
};

/// Spec 16, section 5: refines `current`, its neighbours and all their points; other observers are
/// fixed. Gathers under the read lock, solves without a lock, and commits in one write section
/// that re-checks what has died meanwhile. An epoch change in between drops the result.
LocalBundleResult local_bundle_adjustment(Map& map, KeyFrameId current,
                                          const std::atomic<bool>* abort, bool monocular = false,
                                          int n_threads = 1);

}  // namespace orbslam
