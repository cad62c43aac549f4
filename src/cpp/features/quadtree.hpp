// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "features/kernels.hpp"

namespace orbslam {

/// Chooses corners that are spread over an area. The area is divided into quarters until the number
/// of boxes reaches about the number of wanted corners. Then the strongest corner of each box is
/// kept. See docs/method/features.md#even-distribution.
class Quadtree {
 public:
  /// `corners` lie in [0, width) x [0, height). Returns about `quota` of them, at most
  /// max(quota + 2, 4 * round(width / height)), last created box first; among equal responses the
  /// first given one. Boxes are divided largest first, of equal ones the last created first.
  /// The list is valid until the next call.
  const std::vector<Corner>& distribute(const std::vector<Corner>& corners, int width, int height,
                                        int quota);

 private:
  struct Node {
    int left, top, right, bottom;
    std::uint32_t begin, end;  ///< its corners in buffers_[side]
    std::uint32_t side;
    bool is_leaf;

    std::uint32_t count() const { return end - begin; }
  };

  void plant_roots(const std::vector<Corner>& corners, int width, int height);
  void sweep();
  void refine(std::size_t quota);
  void divide(std::uint32_t node_index);

  // Nodes in the order of creation. New nodes always go to the front of the list of boxes, so the
  // list front to back is this array read backwards, without the divided nodes.
  std::vector<Node> nodes_;
  std::vector<std::uint32_t> open_;  ///< leaves with more than one corner, to be divided next
  std::vector<std::uint32_t> todo_;
  std::size_t leaf_count_ = 0;
  std::vector<Corner> buffers_[2];
  std::vector<Corner> kept_;
};

}  // namespace orbslam
