// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "base/scale_pyramid.hpp"
#include "features/image_pyramid.hpp"
#include "features/kernels.hpp"

namespace orbslam {

/// Bilinear resize of grey images, the same bytes as cv::resize with INTER_LINEAR but without its
/// threads. Holds the tables and rows of one resize at a time for reuse.
class ResizePlan {
 public:
  /// Fills `target`, which has its size already; neither side of it may exceed the source's.
  void resize(const cv::Mat& source, cv::Mat& target, const Kernels& kernels);

 private:
  void prepare_columns(int source_width, int width);

  std::vector<std::int32_t> index_;
  std::vector<std::int16_t> weights_;
  std::vector<std::int32_t> block_begin_;
  std::vector<std::uint8_t> block_shuffle_;
  bool blocks_fit_ = false;
  std::vector<std::int16_t> rows_[2];
};

/// build_pyramid with buffers that are kept between images. See docs/method/features.md#pyramid.
class PyramidBuilder {
 public:
  ImagePyramid build(const cv::Mat& grey, const ScalePyramid& scales, const Kernels& kernels);

 private:
  ResizePlan plan_;
};

}  // namespace orbslam
