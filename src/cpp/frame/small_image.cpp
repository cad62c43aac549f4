// SPDX-License-Identifier: BSD-3-Clause
#include "frame/small_image.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/errors.hpp"

namespace orbslam {
namespace {

constexpr double kPixels = 1500;
constexpr int kRowStep = 2;  // noise and texture are averaged out by half of the rows as well

}  // namespace

SmallImage shrink_image(const cv::Mat& grey) {
  if (grey.type() != CV_8UC1 || grey.empty()) {
    throw ImageError("a small image is made of a grey image, uint8 (height, width)");
  }
  SmallImage small;
  small.shrink = std::max(
      1, static_cast<int>(std::lround(std::sqrt(static_cast<double>(grey.total()) / kPixels))));
  // A strip thinner than a square is one row, or one column, of what there is.
  small.shrink = std::min({small.shrink, grey.cols, grey.rows});
  small.width = grey.cols / small.shrink;
  small.height = grey.rows / small.shrink;
  const int rows_used = (small.shrink + kRowStep - 1) / kRowStep;
  const auto area = static_cast<std::uint32_t>(rows_used * small.shrink);
  small.pixels.reserve(static_cast<std::size_t>(small.width) *
                       static_cast<std::size_t>(small.height));
  // Whole rows are added first, since the compiler adds many columns of them at once: squares are
  // too narrow for that.
  std::vector<std::uint32_t> columns(static_cast<std::size_t>(small.width) *
                                     static_cast<std::size_t>(small.shrink));
  for (int row = 0; row < small.height; ++row) {
    std::fill(columns.begin(), columns.end(), 0U);
    for (int y = 0; y < small.shrink; y += kRowStep) {
      const std::uint8_t* pixels = grey.ptr<std::uint8_t>(row * small.shrink + y);
      for (std::size_t x = 0; x < columns.size(); ++x) columns[x] += pixels[x];
    }
    for (auto column = columns.begin(); column != columns.end(); column += small.shrink) {
      const std::uint32_t sum = std::accumulate(column, column + small.shrink, 0U);
      small.pixels.push_back(static_cast<std::uint8_t>((sum + area / 2) / area));
    }
  }
  return small;
}

}  // namespace orbslam
