// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "frame/frame.hpp"

namespace orbslam {

/// So many keypoints with depth are given points although some of them are far.
inline constexpr std::size_t kFewestDepthPoints = 100;

/// The keypoints whose depths are worth a 3-D point, nearest first, ties by index: all close ones
/// and, up to `n_minimum`, far ones; then one far one more if there is any. Replaces the content of
/// `indices`, whose memory is reused. See docs/method/frame.md#close-and-far-points.
void nearest_keypoints(const Frame& frame, std::size_t n_minimum,
                       std::vector<std::uint32_t>& indices);

}  // namespace orbslam
