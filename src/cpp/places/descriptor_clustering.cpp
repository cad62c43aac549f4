// SPDX-License-Identifier: BSD-3-Clause
#include "places/descriptor_clustering.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <random>

#include "base/parallel.hpp"

namespace orbslam {
namespace {

/// Uniform in [0, n). The standard distributions differ between libraries, this does not.
std::uint64_t draw_below(std::mt19937_64& random, std::uint64_t n) {
  const std::uint64_t unbiased = random.max() - random.max() % n;
  std::uint64_t value = random();
  while (value >= unbiased) value = random();
  return value % n;
}

/// Entry b spreads the bits of byte b over the eight bytes of a word.
constexpr std::array<std::uint64_t, 256> make_spread() {
  std::array<std::uint64_t, 256> table{};
  for (std::size_t byte = 0; byte < 256; ++byte) {
    for (std::size_t bit = 0; bit < 8; ++bit) {
      table[byte] |= static_cast<std::uint64_t>((byte >> bit) & 1) << (8 * bit);
    }
  }
  return table;
}
constexpr auto kSpread = make_spread();

/// Counts, for each of the 256 bits, in how many descriptors it is set.
class BitCounter {
 public:
  void add(const Descriptor& descriptor, std::uint32_t multiplicity) {
    total_ += multiplicity;
    for (; multiplicity > 0; --multiplicity) {
      std::size_t lane = 0;
      for (std::uint64_t word : descriptor.words) {
        for (int byte = 0; byte < 8; ++byte, word >>= 8) lanes_[lane++] += kSpread[word & 255];
      }
      if (++pending_ == 255) flush();
    }
  }
  void add(BitCounter& other) {
    other.flush();
    for (std::size_t bit = 0; bit < counts_.size(); ++bit) counts_[bit] += other.counts_[bit];
    total_ += other.total_;
  }
  Descriptor majority() {
    flush();
    Descriptor centre;
    for (std::size_t bit = 0; bit < counts_.size(); ++bit) {
      const std::uint64_t set = 2 * counts_[bit] >= total_ ? 1 : 0;
      centre.words[bit / 64] |= set << (bit % 64);
    }
    return centre;
  }
  std::uint64_t total() const { return total_; }

 private:
  void flush() {
    for (std::size_t bit = 0; bit < counts_.size(); ++bit) {
      counts_[bit] += (lanes_[bit / 8] >> (8 * (bit % 8))) & 255;
    }
    lanes_.fill(0);
    pending_ = 0;
  }

  std::array<std::uint64_t, 32> lanes_{};  // 256 counters of 8 bits
  std::array<std::uint64_t, 256> counts_{};
  std::uint64_t total_ = 0;
  int pending_ = 0;
};

std::uint64_t seed_weight(const DescriptorSet& set, std::size_t i, std::uint64_t distance,
                          int power) {
  return set.multiplicities[i] * (power == 2 ? distance * distance : distance);
}

/// The first descriptor at which the cumulative weight passes `target`.
template <class Weight>
std::size_t pick(std::size_t size, std::uint64_t target, Weight weight) {
  for (std::size_t i = 0; i < size; ++i) {
    const std::uint64_t w = weight(i);
    if (target < w) return i;
    target -= w;
  }
  return size - 1;
}

std::vector<Descriptor> choose_seeds(const DescriptorSet& set, const ClusteringOptions& options,
                                     std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uint64_t total = 0;
  for (std::size_t i = 0; i < set.size; ++i) total += set.multiplicities[i];
  std::size_t chosen = pick(set.size, draw_below(random, total),
                            [&](std::size_t i) { return set.multiplicities[i]; });

  std::vector<Descriptor> centres{set.descriptors[chosen]};
  std::vector<std::uint16_t> distances(set.size, 257);
  while (centres.size() < static_cast<std::size_t>(options.n_clusters)) {
    total = 0;
    for (std::size_t i = 0; i < set.size; ++i) {
      const int distance = hamming_distance(set.descriptors[i], centres.back());
      distances[i] = std::min(distances[i], static_cast<std::uint16_t>(distance));
      total += seed_weight(set, i, distances[i], options.distance_power);
    }
    if (total == 0) break;
    chosen = pick(set.size, draw_below(random, total), [&](std::size_t i) {
      return seed_weight(set, i, distances[i], options.distance_power);
    });
    centres.push_back(set.descriptors[chosen]);
  }
  return centres;
}

class KMeans {
 public:
  KMeans(const DescriptorSet& set, const ClusteringOptions& options, std::uint64_t seed)
      : set_(set),
        n_threads_(static_cast<std::size_t>(std::max(1, options.n_threads))),
        distances_(set.size) {
    result.centres = choose_seeds(set, options, seed);
    result.cluster_of.assign(set.size, 255);
    counters_.resize(n_threads_ * n_clusters());
  }

  /// One round of assignment and update; false when the assignment did not change.
  bool iterate() {
    previous_ = result.cluster_of;
    std::fill(counters_.begin(), counters_.end(), BitCounter());
    for_each_in_parallel(n_threads_, n_threads_, [this](std::size_t part) { assign_part(part); });
    for (std::size_t i = n_clusters(); i < counters_.size(); ++i) {
      counters_[i % n_clusters()].add(counters_[i]);
    }
    const bool moved = fill_empty_clusters();
    if (result.cluster_of == previous_) return false;
    if (moved) recount();
    for (std::size_t c = 0; c < n_clusters(); ++c) result.centres[c] = counters_[c].majority();
    return true;
  }

  Clustering result;

 private:
  std::size_t n_clusters() const { return result.centres.size(); }

  void assign_part(std::size_t part) {
    const std::size_t begin = set_.size * part / n_threads_;
    const std::size_t end = set_.size * (part + 1) / n_threads_;
    for (std::size_t i = begin; i < end; ++i) {
      std::size_t best = 0;
      int best_distance = hamming_distance(set_.descriptors[i], result.centres[0]);
      for (std::size_t c = 1; c < n_clusters(); ++c) {
        const int distance = hamming_distance(set_.descriptors[i], result.centres[c]);
        if (distance < best_distance) {
          best_distance = distance;
          best = c;
        }
      }
      result.cluster_of[i] = static_cast<std::uint8_t>(best);
      distances_[i] = static_cast<std::uint16_t>(best_distance);
      counters_[part * n_clusters() + best].add(set_.descriptors[i], set_.multiplicities[i]);
    }
  }

  bool fill_empty_clusters() {
    std::vector<std::size_t> members(n_clusters(), 0);
    for (const std::uint8_t c : result.cluster_of) ++members[c];
    bool moved = false;
    for (std::size_t empty = 0; empty < n_clusters(); ++empty) {
      if (members[empty] > 0) continue;
      std::size_t farthest = set_.size;
      for (std::size_t i = 0; i < set_.size; ++i) {
        const bool candidate = members[result.cluster_of[i]] > 1;
        if (candidate && (farthest == set_.size || distances_[i] > distances_[farthest])) {
          farthest = i;
        }
      }
      --members[result.cluster_of[farthest]];
      ++members[empty];
      result.cluster_of[farthest] = static_cast<std::uint8_t>(empty);
      distances_[farthest] = 0;
      moved = true;
    }
    return moved;
  }

  void recount() {
    std::fill(counters_.begin(), counters_.end(), BitCounter());
    for (std::size_t i = 0; i < set_.size; ++i) {
      counters_[result.cluster_of[i]].add(set_.descriptors[i], set_.multiplicities[i]);
    }
  }

  const DescriptorSet& set_;
  std::size_t n_threads_;
  std::vector<std::uint16_t> distances_;
  std::vector<std::uint8_t> previous_;
  std::vector<BitCounter> counters_;  // per part, per cluster
};

}  // namespace

Clustering cluster_descriptors(const DescriptorSet& set, const ClusteringOptions& options,
                               std::uint64_t seed, const std::function<bool()>& keep_going) {
  if (set.size <= static_cast<std::size_t>(options.n_clusters)) {
    Clustering trivial{{set.descriptors, set.descriptors + set.size}, {}};
    for (std::size_t i = 0; i < set.size; ++i) {
      trivial.cluster_of.push_back(static_cast<std::uint8_t>(i));
    }
    return trivial;
  }
  KMeans k_means(set, options, seed);
  for (int iteration = 0; options.max_iterations == 0 || iteration < options.max_iterations;
       ++iteration) {
    if (!k_means.iterate() || !keep_going()) break;
  }
  return std::move(k_means.result);
}

}  // namespace orbslam
