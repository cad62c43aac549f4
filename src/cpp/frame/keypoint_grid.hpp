// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "camera/camera.hpp"
#include "features/keypoint.hpp"

namespace orbslam {

/// Column and row of a grid cell; both -1: outside the grid.
struct GridCell {
  int column = -1, row = -1;
};

/// Keypoint indices in 64 x 48 cells over the undistorted image bounds, for area queries. See
/// docs/method/frame.md#keypoint-grid.
class KeypointGrid {
 public:
  static constexpr int kColumns = 64;
  static constexpr int kRows = 48;

  KeypointGrid() = default;
  KeypointGrid(const std::vector<Keypoint>& keypoints, const ImageBounds& bounds);

  /// The cell of a position: the nearest grid line, not the enclosing cell. Positions inside the
  /// bounds that round to one past the end belong to the last column or row.
  GridCell cell_of(float x, float y) const;

  /// Writes into `found` (cleared first) the keypoints with |x_k - x| < r and |y_k - y| < r
  /// (a square, strict) on levels min_level..max_level; a negative max_level means no upper
  /// limit, and levels are only looked at if min_level > 0 or max_level >= 0.
  /// Order: columns ascending, rows inside a column, index inside a cell. Ties in matching
  /// depend on it.
  void features_in_area(const std::vector<Keypoint>& keypoints, float x, float y, float r,
                        int min_level, int max_level, std::vector<std::uint32_t>& found) const;

 private:
  ImageBounds bounds_;
  float inverse_cell_width_ = 0, inverse_cell_height_ = 0;
  std::vector<std::uint32_t> offsets_;  // column-major: cell (column, row) = column * kRows + row
  std::vector<std::uint32_t> indices_;
};

}  // namespace orbslam
