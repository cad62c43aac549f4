// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "frame/frame.hpp"

namespace orbslam {

/// Sum of the corners' responses on the two finest levels, in grey levels: blur takes away the
/// finest detail first, and with it number and strength of these corners. To be compared with that
/// of other frames of the same camera only. See docs/method/relocalization.md#blurred-frames.
///
/// Of a frame with more than `n_usual` corners the share of the strongest ones counts that it has
/// too many: it was extracted with more than the others, and is no sharper for it.
double sharpness(const Frame& frame, std::size_t n_usual);

/// Mean response of the corners on the two finest levels by that of the corners from level 4 on; 0
/// if there are none. Contrast and texture move both, blur takes away the former first. See
/// docs/method/tracking.md#evidence.
double fine_detail(const Frame& frame);

}  // namespace orbslam
