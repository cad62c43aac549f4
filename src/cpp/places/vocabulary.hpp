// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/descriptor.hpp"
#include "frame/frame.hpp"

namespace orbslam {

/// Direct index and matching by words group features by the node at this tree depth, whatever
/// the depth of the tree (with the well-known depth-6 vocabulary: "4 levels up").
inline constexpr int kDirectIndexDepth = 2;

enum class Scoring : std::uint32_t { kL1 = 0, kL2, kChiSquare, kKl, kBhattacharyya, kDotProduct };
enum class Weighting : std::uint32_t { kTfIdf = 0, kTf, kIdf, kBinary };

/// A node as text files list them (ORBvoc.txt): line n describes node n, the root is node 0.
struct VocabularyNode {
  std::uint32_t parent = 0;
  bool is_word = false;
  Descriptor centre;
  double weight = 0;  ///< of a word: its inverse document frequency
};

struct Quantised {
  std::uint32_t word = 0;
  std::uint32_t node = 0;  ///< ancestor at kDirectIndexDepth, or the leaf if it is shallower
  double weight = 0;
};

/// A tree over ORB descriptors whose leaves are the visual words (Galvez-Lopez and Tardos, 2012).
/// Immutable, shared by threads and systems. Node numbers seen from outside are those of the text
/// format. Either memory-mapped from the binary format or built from a list of nodes.
class Vocabulary {
 public:
  /// Memory-maps a file in the binary format (places/vocabulary_file.hpp). Pages are shared
  /// between processes. Throws VocabularyError naming the path and what is wrong.
  static std::shared_ptr<const Vocabulary> open(const std::string& path);
  /// Nodes in text order without the root. Throws VocabularyError naming the first bad node.
  static std::shared_ptr<const Vocabulary> from_nodes(int branching, int depth, Scoring scoring,
                                                      Weighting weighting,
                                                      const std::vector<VocabularyNode>& nodes);
  ~Vocabulary();

  /// Writes the binary format to a temporary name, then renames.
  void save(const std::string& path) const;

  int branching() const;
  int depth() const;
  Scoring scoring() const;
  Weighting weighting() const;
  std::size_t n_nodes() const;  ///< the root included
  std::size_t n_words() const;
  std::uint64_t hash() const;  ///< of the content; saved maps remember it
  std::vector<VocabularyNode> nodes() const;  ///< for the text writer

  Quantised quantise(const Descriptor& descriptor) const;
  /// Words and direct index of an image (spec 11, section 4).
  void transform(const std::vector<Descriptor>& descriptors, WordVector& words,
                 DirectIndex& direct_index) const;

 private:
  struct Impl;
  explicit Vocabulary(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// L1 score of two word vectors, 0 (disjoint) to 1 (identical).
double similarity(const WordVector& a, const WordVector& b);

/// Fills words and direct index of a frame that is not shared yet (idempotent).
void describe(Frame& frame, const Vocabulary& vocabulary);

}  // namespace orbslam
