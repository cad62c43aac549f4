// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "map/map.hpp"
#include "optimize/sighting_alignment.hpp"

namespace orbslam {

struct KeyframeAlignment {
  int n_patches = 0;         ///< points that got their reference sighting
  AlignmentCounts counts{};  ///< sightings that were tried, by result; entry 0: aligned
};

/// Aligns sightings to the patches of their points, in a new keyframe and in those of its
/// neighbours that still have their images: each sighting once. A point without a patch gets that
/// of its youngest sighting in these keyframes. With `patches_only` nothing is aligned. Reads and
/// writes under the locks of the map, but aligns without a lock. Sightings that were removed in
/// between are ignored. A keyframe that is dead gives an empty result. See
/// docs/method/alignment.md#new-keyframes.
KeyframeAlignment align_keyframes(Map& map, KeyFrameId current, bool patches_only = false,
                                  int n_threads = 1);

/// Updates the noise factors of the map by the residuals that an adjustment leaves in its aligned
/// sightings. `bundle` is solved. Takes no lock.
void measure_noise(const GatheredBundle& bundle, NoiseFactors& noise);

}  // namespace orbslam
