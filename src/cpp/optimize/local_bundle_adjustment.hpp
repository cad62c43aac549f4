// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>

#include "map/map.hpp"
#include "optimize/bundle_adjustment.hpp"
#include "optimize/inertial_keyframes.hpp"

namespace orbslam {

struct LocalBundleResult {
  int n_local_keyframes = 0;  ///< `current` and its neighbours
  int n_fixed_keyframes = 0;  ///< cameras held still, local or not
  int n_points = 0, n_observations = 0;
  int n_imu_links = 0;     ///< residuals of the IMU
  int n_erased = 0;        ///< observations removed as outliers
  bool committed = false;  ///< the map was changed
  BundleSummary summary;
};

/// Refines `current`, its neighbours and all their points; other observers of these are fixed
/// (Mur-Artal et al. 2015, section VI-D). Two stages (BundleOptions): with kernels, then without,
/// on the inliers of the first. Gathers under the read lock, solves without a lock, and commits in
/// one write section, which skips objects that have died since. If the map was cleared in between,
/// the result is dropped. A dead or unknown `current` gives an empty result (after a reset).
///
/// Fixed are the root of the map, the outer observers and, where there are none, the oldest local
/// keyframe. With a single camera and one fixed pose the scale is kept as well: the distances of
/// the others from that one have the same sum as before. `abort` is polled once per iteration;
/// nullptr: never. After an abort the progress is written; observations are erased only if the
/// first stage was finished. With `inertial` the newest keyframes in time that have a state of the
/// IMU are local, too, with residuals of the IMU between them; the scale is then no gauge.
/// `measures_noise`: the noise factors of the map follow the aligned sightings
/// (keyframe_alignment.hpp). See docs/method/mapping.md#local-bundle-adjustment and
/// docs/method/adjustment.md#local-bundle-adjustment.
LocalBundleResult local_bundle_adjustment(Map& map, KeyFrameId current,
                                          const std::atomic<bool>* abort, bool monocular = false,
                                          int n_threads = 1,
                                          BundleSolver solver = BundleOptions().solver,
                                          InertialKeyframes* inertial = nullptr,
                                          bool measures_noise = false);

}  // namespace orbslam
