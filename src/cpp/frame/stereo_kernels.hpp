// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// No C++ library header here: this file is also read by a source that is compiled for another
// instruction set, and inline functions shared with it would break the one-definition rule.

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

/// The version for any processor.
void shifted_sad_portable(const WindowPair& windows, int* sums);
#if defined(__x86_64__)
/// Same results as the portable version; needs a CPU with AVX2.
void shifted_sad_avx2(const WindowPair& windows, int* sums);
#endif

/// The fastest version this CPU can run.
ShiftedSad best_shifted_sad();

}  // namespace orbslam::stereo
