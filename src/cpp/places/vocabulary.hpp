// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/descriptor.hpp"
#include "frame/frame.hpp"
#include "places/vocabulary_file.hpp"

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

/// The same as columns, for trees of a million nodes. Row i describes node i + 1.
struct NodeTable {
  std::vector<std::uint32_t> parents;
  std::vector<std::uint8_t> is_word;
  std::vector<Descriptor> centres;
  std::vector<double> weights;
};

/// Borrowed columns. Centres are 32 bytes per row without alignment.
struct NodeRows {
  std::size_t count = 0;
  const std::uint32_t* parents = nullptr;
  const std::uint8_t* is_word = nullptr;
  const std::uint8_t* centres = nullptr;
  const double* weights = nullptr;
};

struct NodeProblem {
  std::size_t node = 0;  ///< number in the text format
  std::string what;
};

/// The first row that breaks the rules of the tree, or nothing: parents come before their children,
/// words have no children, the others have 1 to `branching`, no path is longer than `depth`,
/// weights are finite and not negative.
std::optional<NodeProblem> find_problem(int branching, int depth, const NodeRows& rows);

/// The leaf of a descriptor. At every node the descent takes the nearest child, or the first of
/// equal ones.
struct Quantised {
  std::uint32_t word = 0;
  std::uint32_t node = 0;  ///< ancestor at kDirectIndexDepth, or the leaf if it is shallower
  double weight = 0;
};

/// A tree over ORB descriptors whose leaves are the visual words (Galvez-Lopez and Tardos, 2012).
/// Immutable, shared by threads and systems. The public interface numbers nodes as the text format
/// does. Either memory-mapped from the binary format or built from a list of nodes. See
/// docs/method/words.md#vocabulary.
class Vocabulary {
 public:
  /// Memory-maps a file in the binary format (places/vocabulary_file.hpp). Pages are shared
  /// between processes. Throws VocabularyError naming the path and what is wrong. The file must
  /// not be cut short while it is open; replacing it by a rename, as save() does, is harmless.
  static std::shared_ptr<const Vocabulary> open(const std::string& path);
  /// Nodes in text order without the root. Throws VocabularyError naming the first bad node.
  static std::shared_ptr<const Vocabulary> from_nodes(int branching, int depth, Scoring scoring,
                                                      Weighting weighting,
                                                      const std::vector<VocabularyNode>& nodes);
  /// Throws VocabularyError as well when scoring is not L1, the only one the system computes.
  static std::shared_ptr<const Vocabulary> from_rows(int branching, int depth, Scoring scoring,
                                                     Weighting weighting, const NodeRows& rows);
  ~Vocabulary();

  /// Writes the binary format to a temporary name, then renames. The short form keeps the comment.
  void save(const std::string& path) const;
  void save(const std::string& path, const std::string& comment,
            const VocabularySource& source) const;

  int branching() const;
  int depth() const;
  Scoring scoring() const;
  Weighting weighting() const;
  std::size_t n_nodes() const;  ///< the root included
  std::size_t n_words() const;
  std::uint64_t hash() const;  ///< of the content, quick
  /// The content for a cryptographic hash: the tree's parameters and its sections, as pieces of
  /// memory that live as long as the vocabulary.
  std::vector<std::string_view> content() const;
  std::string comment() const;      ///< where it comes from, its licence
  VocabularySource source() const;  ///< the text file it was made from, if any
  std::vector<VocabularyNode> nodes() const;
  NodeTable table() const;  ///< for the text writer
  /// Throws VocabularyError unless the content matches its hash. open() has done so for files up
  /// to VocabularyImage::kSmallFile bytes, of larger ones it has read the small tables only.
  void check_content() const;

  Quantised quantise(const Descriptor& descriptor) const;
  /// Words and direct index of an image. A word counts with its weight in the tree, with
  /// TF-IDF and TF weighting once per occurrence; the counts are then divided by their sum. Words
  /// of weight 0 are left out of both. See docs/method/words.md#word-vectors.
  void transform(const std::vector<Descriptor>& descriptors, WordVector& words,
                 DirectIndex& direct_index) const;
  /// The same of features whose words are known, kNoWord for stopped ones. Throws VocabularyError
  /// when there is no such word.
  void transform(const std::uint32_t* words_of_features, std::size_t n_features, WordVector& words,
                 DirectIndex& direct_index) const;

 private:
  struct Impl;
  explicit Vocabulary(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// L1 score of two word vectors, 0 (disjoint) to 1 (identical): the sum, over the common words, of
/// the smaller weight.
double similarity(const WordVector& a, const WordVector& b);

/// Fills words and direct index of a frame that is not shared yet (idempotent).
void describe(Frame& frame, const Vocabulary& vocabulary);
/// The same with the words of its features, kNoWord for stopped ones: nothing has to be searched.
void describe(Frame& frame, const Vocabulary& vocabulary, const std::uint32_t* words_of_features);

}  // namespace orbslam
