// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace orbslam {

/// A reduced image of some 1500 pixels, each the mean of a square of the full image. It serves to
/// estimate the camera's rotation (Klein and Murray 2008, section 3: the "small blurry image"). Row
/// by row, the top left first.
struct SmallImage {
  int width = 0, height = 0;
  int shrink = 1;  ///< pixels of the whole image to a side of a small one
  std::vector<std::uint8_t> pixels;

  bool empty() const { return pixels.empty(); }
};

/// Shrinks a grey image (CV_8UC1). Incomplete squares at the right and at the bottom are not used.
/// Only every other row is read. Throws ImageError for an image of another type.
SmallImage shrink_image(const cv::Mat& grey);

}  // namespace orbslam
