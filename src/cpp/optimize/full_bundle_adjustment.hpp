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
  /// No iteration is begun that would probably end later. 0: no limit, and the result does not
  /// depend on the speed of the computer. The result so far is used.
  double max_seconds = 0;
};

// Full bundle adjustment refines all keyframes, unpublished ones included, and all points; no
// observation is erased. The map may change between its steps: tracking and mapping continue while
// it is solved. See docs/method/adjustment.md#full-bundle-adjustment and
// docs/method/loops.md#after-a-loop.

/// All keyframes of a map (kNoMap: the active one) that are tied to each other by points, and these
/// points. Others (a keyframe that was just inserted and has not been processed) are left out,
/// because their position relative to the rest is not determined. If the map falls apart, the part
/// with most keyframes is taken. The first keyframe of the bundle is fixed: it is the root unless
/// that one has lost its points. Takes the read lock in short sections, so that tracking does not
/// wait for a large map. Changes between the sections are accepted.
GatheredBundle gather_full_bundle(const Map& map, MapIndex which = kNoMap);

/// Solves a gathered bundle in place, without a lock. It counts as solved, and may be committed,
/// unless there was no step that lowered the cost, the result is not finite or `abort` was raised,
/// which is polled once per iteration; nullptr: never.
BundleSummary solve_full_bundle(GatheredBundle& bundle, const FullBundleOptions& options,
                                const std::atomic<bool>* abort, int n_threads);

struct FullBundleCommit {
  bool committed = false;  ///< the map was changed
  /// Moved with others, because they were not in the bundle (mostly new objects).
  int n_followed_keyframes = 0, n_followed_points = 0;
};

/// Moves the map to the result, in one prepared write section, which counts as a big change.
/// Objects that have died since the gathering are left out. Keyframes that are not part of the
/// bundle keep their pose relative to their parent in the spanning tree (those without a parent: to
/// the keyframe before them), points their place before their reference keyframe. Motions by others
/// in between, e.g. by local bundle adjustment, are overwritten: pause local mapping, and let it
/// refine the newest keyframes afterwards.
///
/// Nothing is changed when the bundle is not solved, when the map was cleared since, and when
/// another big change has happened since (the result would undo a loop that was closed in between).
FullBundleCommit commit_full_bundle(Map& map, const GatheredBundle& bundle);

}  // namespace orbslam
