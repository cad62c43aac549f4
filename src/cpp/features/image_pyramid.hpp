// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "base/scale_pyramid.hpp"

namespace orbslam {

/// Grey images (CV_8UC1) of decreasing size; level i is resized from level i-1.
/// It belongs to the result of one extraction, stereo matching reads it afterwards.
struct ImagePyramid {
  std::vector<cv::Mat> levels;
};

/// Bilinear pyramid of a grey image. Level 0 shares the input's pixels; levels too small for a
/// pixel are empty. See docs/method/features.md#pyramid.
ImagePyramid build_pyramid(const cv::Mat& grey, const ScalePyramid& scales);

}  // namespace orbslam
