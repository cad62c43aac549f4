// SPDX-License-Identifier: BSD-3-Clause
#include "places/vocabulary.hpp"

#include <algorithm>
#include <mutex>
#include <utility>

#include "base/errors.hpp"
#include "places/vocabulary_builder.hpp"

namespace orbslam {
namespace {

/// The nodes under which the direct index groups features: those at kDirectIndexDepth and the
/// words above it. In breadth-first order they end before `end`.
struct Groups {
  std::uint32_t end = 0;
  std::vector<std::uint32_t> rank;  ///< per node below `end`: position in `ids`
  std::vector<std::uint32_t> ids;   ///< numbers in the text format, ascending
};

Groups find_groups(const VocabularyImage& image) {
  const std::uint8_t* counts = image.child_count();
  const std::uint32_t* ids = image.original_id();
  Groups groups;
  std::uint32_t begin = 0, end = 1;
  std::vector<std::uint32_t> nodes;
  for (int level = 0; begin < end; ++level) {
    std::uint32_t next_end = end;
    for (std::uint32_t node = begin; node < end; ++node) {
      next_end += counts[node];
      if (level == kDirectIndexDepth || counts[node] == 0) nodes.push_back(node);
    }
    groups.end = end;
    if (level == kDirectIndexDepth) break;
    begin = end;
    end = next_end;
  }
  std::sort(nodes.begin(), nodes.end(),
            [ids](std::uint32_t a, std::uint32_t b) { return ids[a] < ids[b]; });
  groups.rank.resize(groups.end);
  for (const std::uint32_t node : nodes) {
    if (!groups.ids.empty() && groups.ids.back() == ids[node]) {
      throw VocabularyError("two nodes have the same number; convert the vocabulary again");
    }
    groups.rank[node] = static_cast<std::uint32_t>(groups.ids.size());
    groups.ids.push_back(ids[node]);
  }
  return groups;
}

/// From one word per feature, in any order, to ascending words with L1-normalised weights.
void count_words(const double* idf, Weighting weighting, WordVector& words) {
  const bool counts_matter = weighting == Weighting::kTfIdf || weighting == Weighting::kTf;
  std::sort(words.words.begin(), words.words.end());
  std::size_t n_distinct = 0;
  double sum = 0;
  for (const std::uint32_t word : words.words) {
    const bool repeated = n_distinct > 0 && words.words[n_distinct - 1] == word;
    if (!repeated) {
      words.words[n_distinct++] = word;
      words.weights.push_back(idf[word]);
    } else if (counts_matter) {
      words.weights.back() += idf[word];
    }
  }
  words.words.resize(n_distinct);
  for (const double weight : words.weights) sum += weight;
  for (double& weight : words.weights) weight /= sum;
}

}  // namespace

struct Vocabulary::Impl {
  Impl(VocabularyImage vocabulary_image, std::string vocabulary_name)
      : image(std::move(vocabulary_image)), name(std::move(vocabulary_name)) {
    image.check(name);
    if (image.header().scoring != static_cast<std::uint32_t>(Scoring::kL1)) {
      throw VocabularyError(name + ": scoring type " + std::to_string(image.header().scoring) +
                            " is not supported, only 0 (L1)");
    }
    centres = image.centres();
    child_count = image.child_count();
    link = image.link();
    weight = image.weight();
    groups = find_groups(image);
  }

  struct Leaf {
    std::uint32_t word;
    std::uint32_t group;  ///< rank among the groups
  };
  Leaf descend(const Descriptor& descriptor) const {
    std::uint32_t node = 0, group = 0;
    for (int level = 1; child_count[node] > 0; ++level) {
      node = nearest(descriptor, link[node], child_count[node]);
      if (level <= kDirectIndexDepth) group = node;
    }
    return {link[node], groups.rank[group]};
  }
  /// The group of every word; found when it is first asked for.
  const std::vector<std::uint32_t>& group_of_words() const {
    std::call_once(words_grouped, [this] {
      const std::uint64_t n_nodes = image.header().n_nodes;
      std::vector<std::uint32_t> group_of_nodes(n_nodes, 0);
      group_of_word.resize(image.header().n_words);
      // Breadth first: the nodes that groups are made of come first, parents before children.
      for (std::uint32_t node = 0; node < n_nodes; ++node) {
        if (node < groups.end) group_of_nodes[node] = groups.rank[node];
        if (child_count[node] == 0) {
          group_of_word[link[node]] = group_of_nodes[node];
          continue;
        }
        for (std::uint32_t child = link[node]; child < link[node] + child_count[node]; ++child) {
          group_of_nodes[child] = group_of_nodes[node];
        }
      }
    });
    return group_of_word;
  }
  /// Words and direct index of features of which `leaf_of(i)` tells word and group.
  template <class LeafOf>
  void collect(std::size_t n_features, LeafOf&& leaf_of, WordVector& words,
               DirectIndex& direct_index) const;
  /// Ties go to the first child.
  std::uint32_t nearest(const Descriptor& descriptor, std::uint32_t first,
                        std::uint32_t count) const {
    std::uint32_t best = first;
    int best_distance = hamming_distance(descriptor, centres[first]);
    for (std::uint32_t child = first + 1; child < first + count; ++child) {
      const int distance = hamming_distance(descriptor, centres[child]);
      if (distance < best_distance) {
        best_distance = distance;
        best = child;
      }
    }
    return best;
  }

  VocabularyImage image;
  std::string name;
  const Descriptor* centres = nullptr;
  const std::uint8_t* child_count = nullptr;
  const std::uint32_t* link = nullptr;
  const double* weight = nullptr;
  Groups groups;
  mutable std::once_flag words_grouped;
  mutable std::vector<std::uint32_t> group_of_word;
};

Vocabulary::Vocabulary(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Vocabulary::~Vocabulary() = default;

std::shared_ptr<const Vocabulary> Vocabulary::open(const std::string& path) {
  auto impl = std::make_unique<Impl>(VocabularyImage::map(path), path);
  return std::shared_ptr<const Vocabulary>(new Vocabulary(std::move(impl)));
}

std::shared_ptr<const Vocabulary> Vocabulary::from_rows(int branching, int depth, Scoring scoring,
                                                        Weighting weighting, const NodeRows& rows) {
  auto impl = std::make_unique<Impl>(build_image({branching, depth, scoring, weighting}, rows),
                                     "vocabulary in memory");
  return std::shared_ptr<const Vocabulary>(new Vocabulary(std::move(impl)));
}

std::shared_ptr<const Vocabulary> Vocabulary::from_nodes(int branching, int depth, Scoring scoring,
                                                         Weighting weighting,
                                                         const std::vector<VocabularyNode>& nodes) {
  NodeTable table;
  for (const VocabularyNode& node : nodes) {
    table.parents.push_back(node.parent);
    table.is_word.push_back(node.is_word ? 1 : 0);
    table.centres.push_back(node.centre);
    table.weights.push_back(node.weight);
  }
  return from_rows(branching, depth, scoring, weighting, rows_of(table));
}

void Vocabulary::save(const std::string& path) const { save(path, comment(), source()); }

void Vocabulary::save(const std::string& path, const std::string& comment,
                      const VocabularySource& source) const {
  write_vocabulary(impl_->image, path, comment, source);
}

int Vocabulary::branching() const { return static_cast<int>(impl_->image.header().branching); }
int Vocabulary::depth() const { return static_cast<int>(impl_->image.header().depth); }
Scoring Vocabulary::scoring() const { return static_cast<Scoring>(impl_->image.header().scoring); }
Weighting Vocabulary::weighting() const {
  return static_cast<Weighting>(impl_->image.header().weighting);
}
std::size_t Vocabulary::n_nodes() const { return impl_->image.header().n_nodes; }
std::size_t Vocabulary::n_words() const { return impl_->image.header().n_words; }
std::uint64_t Vocabulary::hash() const { return impl_->image.header().content_hash; }
std::vector<std::string_view> Vocabulary::content() const {
  const VocabularyHeader& h = impl_->image.header();
  const auto piece = [](const void* data, std::size_t size) {
    return std::string_view(static_cast<const char*>(data), size);
  };
  return {piece(&h.branching, 4 * sizeof(std::uint32_t)),
          piece(&h.n_nodes, 2 * sizeof(std::uint64_t)),
          piece(impl_->centres, h.n_nodes * sizeof(Descriptor)),
          piece(impl_->child_count, h.n_nodes),
          piece(impl_->link, h.n_nodes * sizeof(std::uint32_t)),
          piece(impl_->image.original_id(), h.n_nodes * sizeof(std::uint32_t)),
          piece(impl_->weight, h.n_words * sizeof(double))};
}
std::string Vocabulary::comment() const { return impl_->image.comment(); }
VocabularySource Vocabulary::source() const { return impl_->image.header().source; }
void Vocabulary::check_content() const { impl_->image.check_content(impl_->name); }

NodeTable Vocabulary::table() const { return unpack_image(impl_->image, impl_->name); }

std::vector<VocabularyNode> Vocabulary::nodes() const {
  const NodeTable columns = table();
  std::vector<VocabularyNode> nodes(columns.parents.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    nodes[i] = {columns.parents[i], columns.is_word[i] != 0, columns.centres[i],
                columns.weights[i]};
  }
  return nodes;
}

Quantised Vocabulary::quantise(const Descriptor& descriptor) const {
  const Impl::Leaf leaf = impl_->descend(descriptor);
  return {leaf.word, impl_->groups.ids[leaf.group], impl_->weight[leaf.word]};
}

template <class LeafOf>
void Vocabulary::Impl::collect(std::size_t n_features, LeafOf&& leaf_of, WordVector& words,
                               DirectIndex& direct_index) const {
  std::vector<Leaf> leaves(n_features);
  std::vector<std::uint32_t> ends(groups.ids.size(), 0);  // counts at first
  words.words.clear();
  words.weights.clear();
  for (std::size_t i = 0; i < n_features; ++i) {
    leaves[i] = leaf_of(i);
    if (leaves[i].word == kNoWord) continue;
    if (!(weight[leaves[i].word] > 0)) {
      leaves[i].word = kNoWord;
      continue;
    }
    words.words.push_back(leaves[i].word);
    ++ends[leaves[i].group];
  }
  const std::size_t n_described = words.words.size();
  count_words(weight, static_cast<Weighting>(image.header().weighting), words);

  direct_index.nodes.clear();
  direct_index.offsets.assign(1, 0);
  direct_index.indices.resize(n_described);
  direct_index.words.resize(n_described);
  std::uint32_t begin = 0;
  for (std::size_t group = 0; group < ends.size(); ++group) {
    const std::uint32_t count = ends[group];
    ends[group] = begin;
    begin += count;
    if (count == 0) continue;
    direct_index.nodes.push_back(groups.ids[group]);
    direct_index.offsets.push_back(begin);
  }
  for (std::size_t i = 0; i < n_features; ++i) {
    if (leaves[i].word == kNoWord) continue;
    const std::uint32_t place = ends[leaves[i].group]++;
    direct_index.indices[place] = static_cast<std::uint32_t>(i);
    direct_index.words[place] = leaves[i].word;
  }
}

void Vocabulary::transform(const std::vector<Descriptor>& descriptors, WordVector& words,
                           DirectIndex& direct_index) const {
  impl_->collect(
      descriptors.size(), [&](std::size_t i) { return impl_->descend(descriptors[i]); }, words,
      direct_index);
}

void Vocabulary::transform(const std::uint32_t* words_of_features, std::size_t n_features,
                           WordVector& words, DirectIndex& direct_index) const {
  const std::vector<std::uint32_t>& groups = impl_->group_of_words();
  const auto leaf_of = [&](std::size_t i) -> Impl::Leaf {
    const std::uint32_t word = words_of_features[i];
    if (word == kNoWord) return {word, 0};
    if (word >= groups.size()) {
      throw VocabularyError("the vocabulary has no word " + std::to_string(word));
    }
    return {word, groups[word]};
  };
  impl_->collect(n_features, leaf_of, words, direct_index);
}

double similarity(const WordVector& a, const WordVector& b) {
  double score = 0;
  std::size_t i = 0, j = 0;
  while (i < a.words.size() && j < b.words.size()) {
    if (a.words[i] < b.words[j]) {
      ++i;
    } else if (b.words[j] < a.words[i]) {
      ++j;
    } else {
      score += std::min(a.weights[i++], b.weights[j++]);
    }
  }
  return score;
}

void describe(Frame& frame, const Vocabulary& vocabulary) {
  if (frame.described) return;
  vocabulary.transform(frame.descriptors, frame.words, frame.direct_index);
  frame.described = true;
}

void describe(Frame& frame, const Vocabulary& vocabulary, const std::uint32_t* words_of_features) {
  if (frame.described) return;
  vocabulary.transform(words_of_features, frame.size(), frame.words, frame.direct_index);
  frame.described = true;
}

}  // namespace orbslam
