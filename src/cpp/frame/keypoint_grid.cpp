// SPDX-License-Identifier: BSD-3-Clause
#include "frame/keypoint_grid.hpp"

#include <algorithm>
#include <cmath>

namespace orbslam {
namespace {

constexpr std::size_t kCells = static_cast<std::size_t>(KeypointGrid::kColumns) *
                               static_cast<std::size_t>(KeypointGrid::kRows);

std::size_t cell_index(int column, int row) {
  return static_cast<std::size_t>(column) * KeypointGrid::kRows + static_cast<std::size_t>(row);
}

// Nearest grid line, ties away from zero. The last half cell rounds to one past the end although
// it lies inside the bounds; it belongs to the last cell. -1: outside.
int nearest_line(float coordinate, float minimum, float maximum, float inverse_size, int count) {
  const float line = std::round((coordinate - minimum) * inverse_size);
  if (!(line >= 0.0F && line <= static_cast<float>(count))) return -1;
  const int cell = static_cast<int>(line);
  if (cell < count) return cell;
  return coordinate <= maximum ? count - 1 : -1;
}

struct Range {
  int first, last;  // empty when first > last
};

// Cells that can hold coordinates less than r away. Compared as floats because a query far
// outside need not fit an int.
Range touched_cells(float coordinate, float r, float minimum, float inverse_size, int count) {
  const float first = std::floor((coordinate - minimum - r) * inverse_size);
  const float last = std::ceil((coordinate - minimum + r) * inverse_size);
  const float end = static_cast<float>(count);
  if (!(first < end) || !(last >= 0.0F)) return {0, -1};
  return {static_cast<int>(std::max(first, 0.0F)), static_cast<int>(std::min(last, end - 1.0F))};
}

}  // namespace

KeypointGrid::KeypointGrid(const std::vector<Keypoint>& keypoints, const ImageBounds& bounds)
    : bounds_(bounds),
      inverse_cell_width_(static_cast<float>(kColumns) / (bounds.max_x - bounds.min_x)),
      inverse_cell_height_(static_cast<float>(kRows) / (bounds.max_y - bounds.min_y)),
      offsets_(kCells + 1, 0) {
  // Counting sort by cell; it keeps the indices of a cell ascending.
  constexpr std::uint32_t kOutside = kCells;
  std::vector<std::uint32_t> cells(keypoints.size());
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const GridCell cell = cell_of(keypoints[i].x, keypoints[i].y);
    const bool inside = cell.column >= 0;
    cells[i] = inside ? static_cast<std::uint32_t>(cell_index(cell.column, cell.row)) : kOutside;
    if (inside) ++offsets_[cells[i] + 1];
  }
  for (std::size_t c = 0; c < kCells; ++c) offsets_[c + 1] += offsets_[c];

  indices_.resize(offsets_.back());
  std::vector<std::uint32_t> next(offsets_.begin(), offsets_.end() - 1);
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    if (cells[i] != kOutside) indices_[next[cells[i]]++] = static_cast<std::uint32_t>(i);
  }
}

GridCell KeypointGrid::cell_of(float x, float y) const {
  const int column = nearest_line(x, bounds_.min_x, bounds_.max_x, inverse_cell_width_, kColumns);
  const int row = nearest_line(y, bounds_.min_y, bounds_.max_y, inverse_cell_height_, kRows);
  if (column < 0 || row < 0) return {-1, -1};
  return {column, row};
}

void KeypointGrid::features_in_area(const std::vector<Keypoint>& keypoints, float x, float y,
                                    float r, int min_level, int max_level,
                                    std::vector<std::uint32_t>& found) const {
  found.clear();
  if (indices_.empty()) return;
  const Range columns = touched_cells(x, r, bounds_.min_x, inverse_cell_width_, kColumns);
  const Range rows = touched_cells(y, r, bounds_.min_y, inverse_cell_height_, kRows);
  if (columns.first > columns.last || rows.first > rows.last) return;

  const bool check_levels = min_level > 0 || max_level >= 0;
  for (int column = columns.first; column <= columns.last; ++column) {
    // The rows of one column lie next to each other, so one loop walks through all of them.
    const std::uint32_t end = offsets_[cell_index(column, rows.last) + 1];
    for (std::uint32_t k = offsets_[cell_index(column, rows.first)]; k < end; ++k) {
      const Keypoint& keypoint = keypoints[indices_[k]];
      if (check_levels &&
          (keypoint.level < min_level || (max_level >= 0 && keypoint.level > max_level))) {
        continue;
      }
      if (std::abs(keypoint.x - x) < r && std::abs(keypoint.y - y) < r) {
        found.push_back(indices_[k]);
      }
    }
  }
}

}  // namespace orbslam
