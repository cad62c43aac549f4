// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "features/kernels.hpp"
#include "features/level_placement.hpp"

namespace orbslam {

/// Distance of the origin of corner coordinates from the image's, pixels.
inline constexpr int corner_origin = 16;

/// Which pixels of a level may hold a keypoint.
struct LevelMask {
  const cv::Mat* mask = nullptr;  ///< CV_8UC1 of the size of level 0, 0 = forbidden; null = all
  LevelPlacement placement;       ///< of the level

  /// Position in pixels of the level. None of the level-0 pixels around it may be forbidden.
  bool allows(int x, int y) const;
};

/// FAST corners of one level, found in cells of about 30 pixels: a cell that has corners at the
/// first threshold keeps those, any other takes what the second finds. See
/// docs/method/features.md#corners.
class CornerGrid {
 public:
  /// Corners in the order of cells, row-major in each cell. The list is valid until the next call.
  /// Levels too small for one cell have none. 1 <= minimum_threshold <= initial_threshold < 255.
  const std::vector<Corner>& detect(const cv::Mat& level, int initial_threshold,
                                    int minimum_threshold, const LevelMask& mask,
                                    const Kernels& kernels);

 private:
  struct Layout;
  void score_band(const cv::Mat& level, const Layout& layout, int band, int minimum_threshold,
                  const Kernels& kernels);
  void collect_cell(const Layout& layout, int band, int column, int initial_threshold,
                    const LevelMask& mask, const Kernels& kernels);

  std::vector<std::uint8_t> band_;       ///< scores of one row of cells
  std::vector<std::uint8_t> score_row_;  ///< scores of one image row
  std::vector<Corner> cell_;
  std::vector<Corner> corners_;
};

}  // namespace orbslam
