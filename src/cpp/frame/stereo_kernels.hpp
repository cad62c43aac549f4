// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "base/vector_unit.hpp"

namespace orbslam::stereo {

constexpr int kHalfWindow = 5;
constexpr int kWindow = 2 * kHalfWindow + 1;
constexpr int kHalfSearch = 5;
constexpr int kShifts = 2 * kHalfSearch + 1;
constexpr int kStripWidth = kWindow + kShifts - 1;

/// The pixels compared around one match: the 11x11 window of the left image and the strip of the
/// right image that all shifted windows cover. Rows are padded to whole vectors; the padding is
/// readable and of no influence.
struct WindowPair {
  alignas(32) unsigned char left[kWindow][16];
  alignas(32) unsigned char right[kWindow][32];
};

/// sums[k]: sum over the window of |(L - L_centre) - (R_k - R_k_centre)| for the right window
/// that starts at column k of the strip, k = 0..10. See docs/method/frame.md#stereo-matching.
using ShiftedSad = void (*)(const WindowPair& windows, int* sums);

/// The one for a unit that this processor has; each gives the same sums.
ShiftedSad shifted_sad_for(VectorUnit unit);

}  // namespace orbslam::stereo
