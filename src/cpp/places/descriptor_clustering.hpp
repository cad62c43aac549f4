// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "base/descriptor.hpp"

namespace orbslam {

/// Distinct descriptors, each standing for `multiplicity` equal ones. Borrowed.
struct DescriptorSet {
  const Descriptor* descriptors = nullptr;
  const std::uint32_t* multiplicities = nullptr;
  std::size_t size = 0;
};

struct ClusteringOptions {
  int n_clusters = 10;       ///< 2 to 255
  int max_iterations = 100;  ///< 0: until an assignment repeats itself
  int distance_power = 1;    ///< seeds are drawn with probability ~ distance^power, 1 or 2
  int n_threads = 1;         ///< does not change the result
};

struct Clustering {
  std::vector<Descriptor> centres;  ///< at most n_clusters, none without members
  std::vector<std::uint8_t> cluster_of;
};

/// k-means in Hamming distance: k-means++ seeding (Arthur and Vassilvitskii, 2007; by the plain
/// distance), ties to the lower cluster, centres by majority of every bit (a tie gives 1). A
/// cluster that loses its members continues from the descriptor farthest from its centre. Up to
/// n_clusters descriptors are a cluster each. `keep_going` is asked once per iteration from the
/// calling thread; when it says no, the result is unfinished. See docs/method/words.md#vocabulary.
Clustering cluster_descriptors(const DescriptorSet& set, const ClusteringOptions& options,
                               std::uint64_t seed, const std::function<bool()>& keep_going);

}  // namespace orbslam
