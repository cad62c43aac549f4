// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "places/vocabulary.hpp"

namespace orbslam {

struct TrainingOptions {
  int branching = 10;
  int depth = 5;
  Weighting weighting = Weighting::kTfIdf;
  std::uint64_t seed = 0;
  int max_iterations = 100;   ///< per k-means; 0: until an assignment repeats itself
  int distance_power = 1;     ///< of the k-means++ seeding, 1 or 2
  double minimum_weight = 0;  ///< words below it are stopped (weight 0)
  int n_threads = 0;          ///< 0: see threads_for(). The result does not depend on it
  static constexpr int kMostThreads = 256;

  /// Throws SettingsError naming the option that is out of range.
  void check() const;
};

/// Descriptors of all training images, one image after the other.
struct TrainingSet {
  std::vector<Descriptor> descriptors;
  std::vector<std::size_t> image_ends;  ///< per image: one past its last descriptor
};

/// Called with the fraction done, 0 to 1, on the calling thread. False cancels, and there are no
/// further calls.
using TrainingProgress = std::function<bool(double)>;

/// Hierarchical k-means (Nister and Stewenius, 2006, on binary descriptors as in Galvez-Lopez and
/// Tardos, 2012). Equal descriptors are clustered once, with their multiplicity, so that they
/// never make chains of single children. Word weights are ln(images / images with the word) for
/// TF-IDF and IDF, else 1. Node numbers: the children of the root, then the subtree of the first,
/// and so on. Depends on the descriptors, their order, the options and the seed only.
/// Returns nullptr when cancelled. Throws SettingsError, or VocabularyError without descriptors.
/// See docs/method/words.md#vocabulary.
std::shared_ptr<const Vocabulary> train_vocabulary(const TrainingSet& images,
                                                   const TrainingOptions& options,
                                                   const TrainingProgress& progress = {});

}  // namespace orbslam
