// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace orbslam {

/// An image of some 1500 pixels, each the mean of a square of the whole one: what is left of it
/// when nothing is to be recognised, only how the camera turned (Klein and Murray 2008, section 3:
/// the "small blurry image"). Row by row, the top left first.
struct SmallImage {
  int width = 0, height = 0;
  int shrink = 1;  ///< pixels of the whole image to a side of a small one
  std::vector<std::uint8_t> pixels;

  bool empty() const { return pixels.empty(); }
};

/// Shrinks a grey image (CV_8UC1); what is left over at the right and at the bottom is not used.
/// Reads every other row of it. Throws ImageError for an image of another type.
SmallImage shrink_image(const cv::Mat& grey);

}  // namespace orbslam
