// SPDX-License-Identifier: BSD-3-Clause
#include "features/corner_grid.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace orbslam {
namespace {

constexpr int wanted_cell_size = 30;
constexpr int fast_radius = 3;

int cell_size(int length) {
  const int cells = length / wanted_cell_size;
  return (length + cells - 1) / cells;
}

}  // namespace

/// Tested pixels start at 19 in the image; cells tile them. In the band buffer a column and a row
/// of zeros separate neighbouring cells, because suppression must not look across their borders.
struct CornerGrid::Layout {
  int cell_width, cell_height;
  int tested_width, tested_height;
  int columns, bands;
  std::ptrdiff_t stride;

  explicit Layout(const cv::Mat& level)
      : cell_width(cell_size(level.cols - 2 * corner_origin)),
        cell_height(cell_size(level.rows - 2 * corner_origin)),
        tested_width(level.cols - 2 * (corner_origin + fast_radius)),
        tested_height(level.rows - 2 * (corner_origin + fast_radius)),
        columns((tested_width + cell_width - 1) / cell_width),
        bands((tested_height + cell_height - 1) / cell_height),
        stride(1 + columns * (cell_width + 1) + row_padding) {}

  int column_begin(int column) const { return column * cell_width; }
  int column_length(int column) const {
    return std::min(cell_width, tested_width - column * cell_width);
  }
  int band_begin(int band) const { return band * cell_height; }
  int band_length(int band) const {
    return std::min(cell_height, tested_height - band * cell_height);
  }
  /// Where a cell's scores start in a row of the band buffer.
  std::ptrdiff_t buffer_column(int column) const { return 1 + column * (cell_width + 1); }
};

bool LevelMask::allows(int x, int y) const {
  if (mask == nullptr) return true;
  const float u = placement.x.to_image(static_cast<float>(x));
  const float v = placement.y.to_image(static_cast<float>(y));
  const int left = std::min(static_cast<int>(std::floor(u)), mask->cols - 1);
  const int right = std::min(static_cast<int>(std::ceil(u)), mask->cols - 1);
  const int top = std::min(static_cast<int>(std::floor(v)), mask->rows - 1);
  const int bottom = std::min(static_cast<int>(std::ceil(v)), mask->rows - 1);
  const auto* upper = mask->ptr<std::uint8_t>(top);
  const auto* lower = mask->ptr<std::uint8_t>(bottom);
  return upper[left] != 0 && upper[right] != 0 && lower[left] != 0 && lower[right] != 0;
}

const std::vector<Corner>& CornerGrid::detect(const cv::Mat& level, int initial_threshold,
                                              int minimum_threshold, const LevelMask& mask,
                                              const Kernels& kernels) {
  corners_.clear();
  if (level.cols - 2 * corner_origin < wanted_cell_size ||
      level.rows - 2 * corner_origin < wanted_cell_size) {
    return corners_;
  }
  const Layout layout(level);
  band_.assign(static_cast<std::size_t>((layout.cell_height + 2) * layout.stride), 0);
  score_row_.resize(static_cast<std::size_t>(layout.tested_width));
  cell_.resize(
      static_cast<std::size_t>(((layout.cell_width + 1) / 2) * ((layout.cell_height + 1) / 2)));
  for (int band = 0; band < layout.bands; ++band) {
    score_band(level, layout, band, minimum_threshold, kernels);
    for (int column = 0; column < layout.columns; ++column) {
      collect_cell(layout, band, column, initial_threshold, mask, kernels);
    }
  }
  return corners_;
}

void CornerGrid::score_band(const cv::Mat& level, const Layout& layout, int band,
                            int minimum_threshold, const Kernels& kernels) {
  const int first = corner_origin + fast_radius;
  const int length = layout.band_length(band);
  for (int y = 0; y < length; ++y) {
    const auto* centre = level.ptr<std::uint8_t>(first + layout.band_begin(band) + y) + first;
    kernels.fast_scores(centre, static_cast<std::ptrdiff_t>(level.step[0]), layout.tested_width,
                        minimum_threshold, score_row_.data());
    std::uint8_t* row = band_.data() + (y + 1) * layout.stride;
    for (int column = 0; column < layout.columns; ++column) {
      std::memcpy(row + layout.buffer_column(column),
                  score_row_.data() + layout.column_begin(column),
                  static_cast<std::size_t>(layout.column_length(column)));
    }
  }
  // A shorter last band would otherwise see a row of the band before.
  std::memset(band_.data() + (length + 1) * layout.stride, 0,
              static_cast<std::size_t>(layout.stride));
}

void CornerGrid::collect_cell(const Layout& layout, int band, int column, int initial_threshold,
                              const LevelMask& mask, const Kernels& kernels) {
  const int found = kernels.local_maxima(
      band_.data() + layout.stride + layout.buffer_column(column), layout.stride,
      layout.column_length(column), layout.band_length(band), cell_.data());
  const int left = fast_radius + layout.column_begin(column);
  const int top = fast_radius + layout.band_begin(band);
  const std::size_t cell_begin = corners_.size();
  bool has_strong = false;
  for (int i = 0; i < found; ++i) {
    Corner corner = cell_[static_cast<std::size_t>(i)];
    corner.x = static_cast<std::uint16_t>(corner.x + left);
    corner.y = static_cast<std::uint16_t>(corner.y + top);
    // A forbidden corner must not suppress the weak corners of its cell either.
    if (!mask.allows(corner.x + corner_origin, corner.y + corner_origin)) continue;
    const bool strong = corner.response >= initial_threshold;
    if (strong && !has_strong) corners_.resize(cell_begin);
    has_strong |= strong;
    if (strong || !has_strong) corners_.push_back(corner);
  }
}

}  // namespace orbslam
