// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "places/vocabulary.hpp"

namespace orbslam {

struct TreeParameters {
  int branching = 10;
  int depth = 5;
  Scoring scoring = Scoring::kL1;
  Weighting weighting = Weighting::kTfIdf;
};

/// Columns of a table as borrowed rows.
NodeRows rows_of(const NodeTable& table);

/// Renumbers nodes breadth-first and writes them in the binary layout, sealed. Throws
/// VocabularyError naming the first bad node or parameter. See docs/method/words.md#vocabulary.
VocabularyImage build_image(const TreeParameters& parameters, const NodeRows& rows);

/// The inverse: nodes in text order. Throws VocabularyError, naming the vocabulary, when the
/// numbers of its nodes are not a permutation.
NodeTable unpack_image(const VocabularyImage& image, const std::string& name);

}  // namespace orbslam
