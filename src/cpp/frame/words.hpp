// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

namespace orbslam {

/// Bag of words of an image: ascending word ids and their weights, L1-normalised. See
/// docs/method/words.md#word-vectors.
struct WordVector {
  std::vector<std::uint32_t> words;
  std::vector<double> weights;
};

/// Stands for the word of a feature whose word is stopped, which is ignored everywhere.
inline constexpr std::uint32_t kNoWord = 0xFFFFFFFFU;

/// Direct index: which features fall under which vocabulary node. Nodes ascend; the features of
/// nodes[i] are indices[offsets[i]] .. indices[offsets[i + 1] - 1], ascending. See
/// docs/method/words.md#groups-of-words.
struct DirectIndex {
  std::vector<std::uint32_t> nodes;
  std::vector<std::uint32_t> offsets;  ///< nodes.size() + 1 entries, or empty
  std::vector<std::uint32_t> indices;
  std::vector<std::uint32_t> words;  ///< of the features, as `indices`: the word of each
};

}  // namespace orbslam
