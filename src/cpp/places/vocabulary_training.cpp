// SPDX-License-Identifier: BSD-3-Clause
#include "places/vocabulary_training.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>
#include <unordered_map>

#include "base/errors.hpp"
#include "base/parallel.hpp"
#include "places/descriptor_clustering.hpp"
#include "places/vocabulary_builder.hpp"

namespace orbslam {
namespace {

/// Nodes with more descriptors than this are clustered one after the other by all threads, the
/// smaller ones side by side.
constexpr std::size_t kLargeNode = 100000;
constexpr double kTreeShare = 0.95;  ///< of the time; the rest counts words

struct DescriptorHash {
  std::size_t operator()(const Descriptor& d) const { return hash_bytes(&d, sizeof d, 0); }
};

struct Node {
  Descriptor centre;
  std::size_t begin = 0, end = 0;  ///< its descriptors
  std::uint64_t seed = 0;
  std::vector<Node> children;
};

class TreeGrower {
 public:
  TreeGrower(const TrainingSet& images, const TrainingOptions& options, std::size_t n_threads,
             const TrainingProgress& progress)
      : options_(options), n_threads_(n_threads), progress_(progress) {
    std::unordered_map<Descriptor, std::size_t, DescriptorHash> place_of;
    place_of.reserve(images.descriptors.size());
    for (const Descriptor& descriptor : images.descriptors) {
      const auto [place, is_new] = place_of.emplace(descriptor, descriptors_.size());
      if (is_new) {
        descriptors_.push_back(descriptor);
        multiplicities_.push_back(1);
      } else {
        ++multiplicities_[place->second];
      }
    }
  }

  /// Level by level, so that progress is even and small nodes can be shared out. False when
  /// cancelled.
  bool grow(Node& root) {
    root.end = descriptors_.size();
    root.seed = options_.seed;
    std::vector<Node*> level{&root};
    for (int depth = 0; depth < options_.depth && !level.empty(); ++depth) {
      finished_ = 0;
      level_size_ = 0;
      depth_ = depth;
      for (const Node* node : level) level_size_ += node->end - node->begin;
      const auto small = std::stable_partition(level.begin(), level.end(), [](const Node* node) {
        return node->end - node->begin > kLargeNode;
      });
      for (auto node = level.begin(); node != small && !cancelled_; ++node) {
        split(**node, n_threads_);
      }
      split_side_by_side({small, level.end()});
      if (cancelled_) return false;

      std::vector<Node*> next;
      for (Node* node : level) {
        for (Node& child : node->children) {
          if (child.end - child.begin > 1) next.push_back(&child);
        }
      }
      level = std::move(next);
    }
    return true;
  }

 private:
  void split_side_by_side(const std::vector<Node*>& nodes) {
    for_each_in_parallel(nodes.size(), n_threads_, [&](std::size_t i) {
      if (!cancelled_) split(*nodes[i], 1);
    });
  }

  void split(Node& node, std::size_t n_threads) {
    const ClusteringOptions clustering_options{options_.branching, options_.max_iterations,
                                               options_.distance_power,
                                               static_cast<int>(n_threads)};
    const std::size_t size = node.end - node.begin;
    const DescriptorSet set{&descriptors_[node.begin], &multiplicities_[node.begin], size};
    const Clustering clustering = cluster_descriptors(set, clustering_options, node.seed,
                                                      [&] { return report(n_threads > 1); });
    adopt(node, clustering);
    finished_ += size;
    report(false);
  }

  /// Makes the children and sorts the node's descriptors by child, keeping their order.
  void adopt(Node& node, const Clustering& clustering) {
    const std::vector<Descriptor> descriptors(
        descriptors_.begin() + static_cast<std::ptrdiff_t>(node.begin),
        descriptors_.begin() + static_cast<std::ptrdiff_t>(node.end));
    const std::vector<std::uint32_t> multiplicities(
        multiplicities_.begin() + static_cast<std::ptrdiff_t>(node.begin),
        multiplicities_.begin() + static_cast<std::ptrdiff_t>(node.end));
    const std::size_t n_clusters = clustering.centres.size();
    std::vector<std::size_t> ends(n_clusters, 0);
    for (const std::uint8_t c : clustering.cluster_of) ++ends[c];
    node.children.resize(n_clusters);
    std::size_t begin = node.begin;
    for (std::size_t c = 0; c < n_clusters; ++c) {
      Node& child = node.children[c];
      child.centre = clustering.centres[c];
      child.begin = begin;
      child.end = begin + ends[c];
      const std::uint64_t path[2] = {node.seed, c};
      child.seed = hash_bytes(path, sizeof path, 0);
      ends[c] = begin;
      begin = child.end;
    }
    for (std::size_t i = 0; i < descriptors.size(); ++i) {
      const std::size_t place = ends[clustering.cluster_of[i]]++;
      descriptors_[place] = descriptors[i];
      multiplicities_[place] = multiplicities[i];
    }
  }

  /// False when cancelled. Only the calling thread calls back. It does so after each further
  /// thousandth of the work, or once per iteration while all threads work on a large node.
  bool report(bool always) {
    if (cancelled_) return false;
    if (!progress_ || std::this_thread::get_id() != caller_) return true;
    const double done = static_cast<double>(finished_) / static_cast<double>(level_size_);
    const double fraction = kTreeShare * (depth_ + done) / options_.depth;
    if (!always && fraction < reported_ + 1e-3) return true;
    reported_ = fraction;
    try {
      if (!progress_(fraction)) cancelled_ = true;
    } catch (...) {
      cancelled_ = true;  // so that the other threads stop, too
      throw;
    }
    return !cancelled_;
  }

  const TrainingOptions& options_;
  std::size_t n_threads_;
  const TrainingProgress& progress_;
  std::thread::id caller_ = std::this_thread::get_id();
  std::vector<Descriptor> descriptors_;
  std::vector<std::uint32_t> multiplicities_;
  std::atomic<std::size_t> finished_{0};
  std::atomic<bool> cancelled_{false};
  std::size_t level_size_ = 0;
  int depth_ = 0;
  double reported_ = 0;
};

/// All children of a node get consecutive numbers, then follow their subtrees.
void list_nodes(const Node& node, std::uint32_t id, NodeTable& table) {
  const auto first = static_cast<std::uint32_t>(table.parents.size() + 1);
  for (const Node& child : node.children) {
    table.parents.push_back(id);
    table.is_word.push_back(child.children.empty() ? 1 : 0);
    table.centres.push_back(child.centre);
    table.weights.push_back(child.children.empty() ? 1.0 : 0.0);
  }
  for (std::size_t i = 0; i < node.children.size(); ++i) {
    list_nodes(node.children[i], first + static_cast<std::uint32_t>(i), table);
  }
}

/// Per word: the number of images in which it occurs.
std::vector<std::uint32_t> count_images(const TrainingSet& images, const Vocabulary& vocabulary,
                                        std::size_t n_threads) {
  std::vector<std::vector<std::uint32_t>> counts(n_threads);
  const std::size_t n_images = images.image_ends.size();
  for_each_in_parallel(n_threads, n_threads, [&](std::size_t part) {
    std::vector<std::uint32_t> n_seen(vocabulary.n_words(), 0);
    std::vector<std::size_t> last_seen(vocabulary.n_words(), n_images);
    for (std::size_t image = part; image < n_images; image += n_threads) {
      const std::size_t begin = image == 0 ? 0 : images.image_ends[image - 1];
      for (std::size_t i = begin; i < images.image_ends[image]; ++i) {
        const std::uint32_t word = vocabulary.quantise(images.descriptors[i]).word;
        if (last_seen[word] != image) ++n_seen[word];
        last_seen[word] = image;
      }
    }
    counts[part] = std::move(n_seen);
  });
  for (std::size_t part = 1; part < counts.size(); ++part) {
    for (std::size_t word = 0; word < counts[0].size(); ++word) {
      counts[0][word] += counts[part][word];
    }
  }
  return counts[0];
}

void weigh_words(const std::vector<std::uint32_t>& n_images_with, std::size_t n_images,
                 double minimum, NodeTable& table) {
  std::size_t word = 0;
  for (std::size_t row = 0; row < table.weights.size(); ++row) {
    if (table.is_word[row] == 0) continue;
    const std::uint32_t n = n_images_with[word++];
    const double weight =
        n == 0 ? 0 : std::log(static_cast<double>(n_images) / static_cast<double>(n));
    table.weights[row] = weight < minimum ? 0 : weight;
  }
}

void check_set(const TrainingSet& images) {
  const auto& ends = images.image_ends;
  if (images.descriptors.empty()) throw VocabularyError("no descriptors to train with");
  if (!std::is_sorted(ends.begin(), ends.end()) || ends.empty() ||
      ends.back() != images.descriptors.size()) {
    throw VocabularyError("image ends must ascend up to the number of descriptors");
  }
}

}  // namespace

void TrainingOptions::check() const {
  const auto check = [](const char* name, double value, double low, double high) {
    if (!(value >= low && value <= high)) {
      throw SettingsError("vocabulary training: " + std::string(name) + " is out of range");
    }
  };
  check("branching (2 to 20)", branching, 2, 20);
  check("depth (1 to 10)", depth, 1, 10);
  check("max_iterations (0 or more)", max_iterations, 0, 1e9);
  check("distance_power (1 or 2)", distance_power, 1, 2);
  check("minimum_weight (0 or more)", minimum_weight, 0, 1e9);
  check("n_threads (0 to 256)", n_threads, 0, kMostThreads);
}

std::shared_ptr<const Vocabulary> train_vocabulary(const TrainingSet& images,
                                                   const TrainingOptions& options,
                                                   const TrainingProgress& progress) {
  options.check();
  check_set(images);
  const auto given = static_cast<std::size_t>(options.n_threads);
  const std::size_t n_threads = given > 0 ? given : threads_for(TrainingOptions::kMostThreads);

  Node root;
  if (!TreeGrower(images, options, n_threads, progress).grow(root)) return nullptr;
  NodeTable table;
  list_nodes(root, 0, table);
  root.children.clear();

  const auto build = [&] {
    return Vocabulary::from_rows(options.branching, options.depth, Scoring::kL1, options.weighting,
                                 rows_of(table));
  };
  std::shared_ptr<const Vocabulary> vocabulary = build();
  if (options.weighting == Weighting::kTfIdf || options.weighting == Weighting::kIdf) {
    if (progress && !progress(kTreeShare)) return nullptr;
    weigh_words(count_images(images, *vocabulary, n_threads), images.image_ends.size(),
                options.minimum_weight, table);
    vocabulary = build();
  }
  if (progress && !progress(1.0)) return nullptr;
  return vocabulary;
}

}  // namespace orbslam
