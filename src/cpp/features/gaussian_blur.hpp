// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "features/kernels.hpp"

namespace orbslam {

/// Gaussian blur 7 x 7 of sigma 2 with reflection at the border (without repeating the edge), the
/// same bytes as cv::GaussianBlur but without its threads. Descriptors are taken from it: see
/// docs/method/features.md#descriptors.
class GaussianBlur {
 public:
  /// `image`: CV_8UC1, at least 4 x 4 pixels. The result shares a buffer of this object and is
  /// valid until the next call.
  cv::Mat blur(const cv::Mat& image, const Kernels& kernels);

 private:
  std::vector<std::int16_t> sums_;  ///< of the columns, one row
  std::vector<std::uint8_t> blurred_;
};

}  // namespace orbslam
