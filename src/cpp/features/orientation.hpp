// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace orbslam {

/// Direction of (x, y) in degrees, [0, 360), good to 0.3 degrees. The same polynomial in float32
/// as cv::fastAtan2 without fused multiply-adds, so that descriptors agree to the bit. See
/// docs/method/features.md#orientation.
float fast_atan2_degrees(float y, float x);

}  // namespace orbslam
