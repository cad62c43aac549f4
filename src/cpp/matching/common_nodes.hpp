// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "base/errors.hpp"
#include "frame/frame.hpp"

namespace orbslam {

/// Feature indices under one vocabulary node.
struct NodeFeatures {
  const std::uint32_t* first;
  const std::uint32_t* last;

  const std::uint32_t* begin() const { return first; }
  const std::uint32_t* end() const { return last; }
};

/// Calls visit(features of a, features of b) for every vocabulary node that both frames have
/// features under, ascending. Throws StateError when a frame has not been described. See
/// docs/method/words.md#groups-of-words.
template <class Visitor>
void for_each_common_node(const Frame& a, const Frame& b, Visitor&& visit) {
  for (const Frame* frame : {&a, &b}) {
    if (!frame->described) {
      throw StateError("frame " + std::to_string(frame->id) +
                       " has no words; call describe() before matching by words");
    }
  }
  const auto features = [](const DirectIndex& index, std::size_t node) {
    const std::uint32_t* all = index.indices.data();
    return NodeFeatures{all + index.offsets[node], all + index.offsets[node + 1]};
  };
  const DirectIndex& index_a = a.direct_index;
  const DirectIndex& index_b = b.direct_index;
  std::size_t i = 0, j = 0;
  while (i < index_a.nodes.size() && j < index_b.nodes.size()) {
    if (index_a.nodes[i] < index_b.nodes[j]) {
      ++i;
    } else if (index_b.nodes[j] < index_a.nodes[i]) {
      ++j;
    } else {
      visit(features(index_a, i++), features(index_b, j++));
    }
  }
}

}  // namespace orbslam
