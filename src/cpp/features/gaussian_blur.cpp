// SPDX-License-Identifier: BSD-3-Clause
#include "features/gaussian_blur.hpp"

namespace orbslam {
namespace {

int reflect(int i, int length) {
  if (i < 0) return -i;
  return i < length ? i : 2 * (length - 1) - i;
}

}  // namespace

cv::Mat GaussianBlur::blur(const cv::Mat& image, const Kernels& kernels) {
  const int width = image.cols, height = image.rows;
  const auto row_length = static_cast<std::size_t>(width + row_padding);
  sums_.resize(row_length + 2 * blur_radius);
  const std::size_t needed = static_cast<std::size_t>(height) * row_length;
  if (blurred_.size() < needed) blurred_.resize(needed);

  std::int16_t* const sums = sums_.data() + blur_radius;
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* rows[7];
    for (int k = 0; k < 7; ++k) {
      rows[k] = image.ptr<std::uint8_t>(reflect(y + k - blur_radius, height));
    }
    kernels.blur_columns(rows, width, sums);
    for (int i = 1; i <= blur_radius; ++i) {
      sums[-i] = sums[i];
      sums[width - 1 + i] = sums[width - 1 - i];
    }
    kernels.blur_row(sums_.data(), width,
                     blurred_.data() + static_cast<std::size_t>(y) * row_length);
  }
  return cv::Mat(height, width, CV_8UC1, blurred_.data(), row_length);
}

}  // namespace orbslam
