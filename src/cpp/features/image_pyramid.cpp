// SPDX-License-Identifier: BSD-3-Clause
#include "features/image_pyramid.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "features/pyramid_builder.hpp"

namespace orbslam {
namespace {

constexpr float weight_one = 2048.0F;

std::int16_t weight(float value) {
  return static_cast<std::int16_t>(std::nearbyintf(value * weight_one));
}

/// Source position of the first of two neighbours and the weight of the second.
struct Neighbours {
  int index;
  float second;
};

Neighbours neighbours_of(int i, double ratio) {
  const float position = static_cast<float>((i + 0.5) * ratio - 0.5);
  const float floor = std::floor(position);
  return {static_cast<int>(floor), position - floor};
}

// The inverse of the inverse ratio is not always the ratio itself; the golden images were made so.
double axis_ratio(int source, int target) {
  return 1.0 / (static_cast<double>(target) / static_cast<double>(source));
}

}  // namespace

void ResizePlan::prepare_columns(int source_width, int width) {
  index_.resize(static_cast<std::size_t>(width));
  const int blocks = (width + 7) / 8;
  weights_.assign(static_cast<std::size_t>(16 * blocks), 0);
  const double ratio = axis_ratio(source_width, width);
  for (int i = 0; i < width; ++i) {
    Neighbours at = neighbours_of(i, ratio);
    const auto column = static_cast<std::size_t>(i);
    index_[column] = std::clamp(at.index, 0, source_width - 2);
    // Outside the row the border pixel counts alone.
    if (at.index < 0) at.second = 0;
    if (at.index >= source_width - 1) at.second = index_[column] < at.index ? 1.0F : 0.0F;
    weights_[2 * column] = weight(1.0F - at.second);
    weights_[2 * column + 1] = weight(at.second);
  }
  blocks_fit_ = source_width >= 16;
  block_begin_.resize(static_cast<std::size_t>(blocks));
  block_shuffle_.assign(static_cast<std::size_t>(16 * blocks), 0);
  for (int b = 0; b < blocks && blocks_fit_; ++b) {
    const int begin = std::min(index_[static_cast<std::size_t>(8 * b)], source_width - 16);
    block_begin_[static_cast<std::size_t>(b)] = begin;
    for (int i = 8 * b; i < std::min(8 * b + 8, width); ++i) {
      const int offset = index_[static_cast<std::size_t>(i)] - begin;
      if (offset + 1 > 15) blocks_fit_ = false;
      block_shuffle_[static_cast<std::size_t>(2 * i)] = static_cast<std::uint8_t>(offset);
      block_shuffle_[static_cast<std::size_t>(2 * i + 1)] = static_cast<std::uint8_t>(offset + 1);
    }
  }
}

void ResizePlan::resize(const cv::Mat& source, cv::Mat& target, const Kernels& kernels) {
  if (source.cols < 2) {  // no second neighbour to read
    cv::resize(source, target, target.size(), 0, 0, cv::INTER_LINEAR);
    return;
  }
  prepare_columns(source.cols, target.cols);
  ResizeColumns columns;
  columns.count = target.cols;
  columns.index = index_.data();
  columns.weights = weights_.data();
  if (blocks_fit_) {
    columns.block_begin = block_begin_.data();
    columns.block_shuffle = block_shuffle_.data();
  }
  const auto row_length = static_cast<std::size_t>(target.cols + row_padding);
  for (auto& row : rows_) row.resize(row_length);

  // Neighbouring target rows share source rows: each is resized once.
  int held[2] = {-1, -1};
  const auto row_of = [&](int y, int slot) {
    if (held[slot] != y) {
      if (held[1 - slot] == y) {
        std::swap(rows_[0], rows_[1]);
        std::swap(held[0], held[1]);
      } else {
        kernels.resize_row(source.ptr<std::uint8_t>(y), columns, rows_[slot].data());
        held[slot] = y;
      }
    }
  };
  const double ratio = axis_ratio(source.rows, target.rows);
  for (int y = 0; y < target.rows; ++y) {
    const Neighbours at = neighbours_of(y, ratio);
    row_of(std::clamp(at.index, 0, source.rows - 1), 0);
    const int below = std::clamp(at.index + 1, 0, source.rows - 1);
    const bool same = below == held[0];
    if (!same) row_of(below, 1);
    kernels.resize_blend(rows_[0].data(), rows_[same ? 0 : 1].data(), weight(1.0F - at.second),
                         weight(at.second), target.cols, target.ptr<std::uint8_t>(y));
  }
}

ImagePyramid PyramidBuilder::build(const cv::Mat& grey, const ScalePyramid& scales,
                                   const Kernels& kernels) {
  ImagePyramid pyramid;
  pyramid.levels.reserve(static_cast<std::size_t>(scales.levels()));
  pyramid.levels.push_back(grey);
  const ImageSize level0{grey.cols, grey.rows};
  for (int level = 1; level < scales.levels(); ++level) {
    const ImageSize size = scales.level_size(level0, level);
    cv::Mat image;
    const cv::Mat& above = pyramid.levels.back();
    if (size.width > 0 && size.height > 0 && !above.empty()) {
      image.create(size.height, size.width, CV_8UC1);
      plan_.resize(above, image, kernels);
    }
    pyramid.levels.push_back(image);
  }
  return pyramid;
}

ImagePyramid build_pyramid(const cv::Mat& grey, const ScalePyramid& scales) {
  return PyramidBuilder().build(grey, scales, kernels_for(best_vector_unit()));
}

}  // namespace orbslam
