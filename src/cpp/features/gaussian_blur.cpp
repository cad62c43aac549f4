// SPDX-License-Identifier: BSD-3-Clause
#include "features/gaussian_blur.hpp"

#include <cstring>

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
  padded_.resize(row_length + 2 * blur_radius);
  sums_.resize(7 * row_length);
  const std::size_t needed = static_cast<std::size_t>(height) * row_length;
  if (blurred_.size() < needed) blurred_.resize(needed);

  const auto sums_of = [&](int y) {
    return sums_.data() + static_cast<std::size_t>((y + blur_radius) % 7) * row_length;
  };
  const auto add_row = [&](int y) {
    const auto* source = image.ptr<std::uint8_t>(reflect(y, height));
    std::memcpy(padded_.data() + blur_radius, source, static_cast<std::size_t>(width));
    for (int i = 1; i <= blur_radius; ++i) {
      padded_[static_cast<std::size_t>(blur_radius - i)] = source[i];
      padded_[static_cast<std::size_t>(blur_radius + width - 1 + i)] = source[width - 1 - i];
    }
    kernels.blur_row(padded_.data(), width, sums_of(y));
  };
  for (int y = -blur_radius; y < blur_radius; ++y) add_row(y);
  for (int y = 0; y < height; ++y) {
    add_row(y + blur_radius);
    const std::uint16_t* rows[7];
    for (int k = 0; k < 7; ++k) rows[k] = sums_of(y + k - blur_radius);
    kernels.blur_columns(rows, width, blurred_.data() + static_cast<std::size_t>(y) * row_length);
  }
  return cv::Mat(height, width, CV_8UC1, blurred_.data(), row_length);
}

}  // namespace orbslam
