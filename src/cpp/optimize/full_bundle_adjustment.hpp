// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>

#include "map/map.hpp"
#include "optimize/bundle_adjustment.hpp"
#include "optimize/bundle_gather.hpp"

namespace orbslam {

struct FullBundleOptions {
  int iterations = 10;  ///< accepted steps at most
  bool robust = true;   ///< Huber kernel on all observations
  /// No iteration is begun that would probably end later; 0: no limit, and the result does not
  /// depend on the speed of the machine. What was reached is used.
  double max_seconds = 0;
};

// Full bundle adjustment refines all keyframes, unpublished ones included, and all points; no
// observation is erased. Its steps let the map change between them: after a loop, tracking and
// mapping go on while it is solved. See docs/method/adjustment.md#full-bundle-adjustment and
// docs/method/loops.md#after-a-loop.

/// All keyframes of a map (kNoMap: the active one) that are tied to each other by points, and these
/// points. Others (a keyframe that was just inserted and has not been processed) are left out:
/// nothing says where they are relative to the rest. If the map falls apart, the part with most
/// keyframes is taken. The first keyframe of the bundle is fixed: it is the root unless that one
/// has lost its points. Takes the read lock in short sections, so that tracking does not wait for a
/// large map; what changes between them is taken as it is found.
GatheredBundle gather_full_bundle(const Map& map, MapIndex which = kNoMap);

/// Solves a gathered bundle in place, without a lock. It counts as solved, and may be committed,
/// unless there was no step that lowered the cost, the result is not finite or `abort` was raised,
/// which is polled once per iteration; nullptr: never.
BundleSummary solve_full_bundle(GatheredBundle& bundle, const FullBundleOptions& options,
                                const std::atomic<bool>* abort, int n_threads);

struct FullBundleCommit {
  bool committed = false;  ///< the map was changed
  /// Moved along with others, because they were not in the bundle (made meanwhile, mostly).
  int n_followed_keyframes = 0, n_followed_points = 0;
};

/// Moves the map to the result, in one write section that was prepared outside of it and counts as
/// a big change. What has died since the gathering is left out. Keyframes that are not part of the
/// bundle keep their pose relative to their parent in the spanning tree (those without a parent: to
/// the keyframe before them), points their place before their reference keyframe. What was moved
/// meanwhile by others, e.g. by local bundle adjustment, is overwritten: keep local mapping still
/// and let it refine the newest keyframes afterwards.
///
/// Nothing is changed when the bundle is not solved, when the map was cleared since, and when
/// another big change has happened since (a loop closed meanwhile would be torn open again).
FullBundleCommit commit_full_bundle(Map& map, const GatheredBundle& bundle);

}  // namespace orbslam
