// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "places/vocabulary.hpp"
#include "support/npy.hpp"

namespace orbslam::testing {

inline std::string bow_file(const std::string& name) {
  return test_data("golden/bow/" + name + ".npy");
}

inline std::vector<Descriptor> read_descriptors(const std::string& name) {
  const auto bytes = read_npy<std::uint8_t>(bow_file(name));
  std::vector<Descriptor> descriptors(bytes.rows());
  std::memcpy(static_cast<void*>(descriptors.data()), bytes.values.data(), bytes.values.size());
  return descriptors;
}

/// The tree of voc_small_k10L3.txt: branching 10, depth 3, 1000 words.
inline std::vector<VocabularyNode> golden_nodes() {
  std::ifstream file(test_data("golden/bow/voc_small_k10L3.txt"));
  std::string header;
  std::getline(file, header);
  std::vector<VocabularyNode> nodes;
  int flag = 0;
  for (VocabularyNode node; file >> node.parent >> flag; nodes.push_back(node)) {
    node.is_word = flag != 0;
    node.centre = {};
    for (int byte = 0, value = 0; byte < 32 && file >> value; ++byte) {
      node.centre.words[byte / 8] |= static_cast<std::uint64_t>(value) << (8 * (byte % 8));
    }
    file >> node.weight;
  }
  return nodes;
}

inline std::shared_ptr<const Vocabulary> golden_vocabulary() {
  return Vocabulary::from_nodes(10, 3, Scoring::kL1, Weighting::kTfIdf, golden_nodes());
}

}  // namespace orbslam::testing
