// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core/mat.hpp>

#include "frame/frame.hpp"
#include "frame/rectifier.hpp"

namespace orbslam {

/// Gives the frame the colours of the image it was made of (uint8; `is_rgb`: the first channel is
/// red, else blue), each at the pixel nearest to the keypoint as it was extracted. A grey image
/// gives none. Throws ImageError for an image of another size or type than the frame's. See
/// docs/method/frame.md#colours. With a rectifier the image is the raw one, of its size.
void sample_colours(const cv::Mat& image, bool is_rgb, Frame& frame,
                    const Rectifier* rectifier = nullptr);

}  // namespace orbslam
