// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "geometry/two_view.hpp"
#include "scenes.hpp"

namespace orbslam::testing {

/// Two views as the search for a model of their motion takes them, `find_best` being one of
/// best_homography() and best_fundamental().
template <auto find_best>
struct ModelScene {
  explicit ModelScene(const TwoViewScene& scene)
      : pairs(gather_pairs(scene.initial, scene.current, scene.matches)) {
    normalize(scene.initial, normalization_1);
    normalize(scene.current, normalization_2);
  }
  ScoredModel best(const std::vector<EightPairs>& samples, double sigma = 1) const {
    return find_best(pairs, samples, normalization_1, normalization_2, sigma);
  }
  PointPairs pairs;
  Normalization normalization_1, normalization_2;
};

/// In how many samples of a golden set the model has another score than the reference's.
template <class Scene>
int n_scored_otherwise(const std::string& set, const std::string& reference_scores) {
  const Scene data(golden_two_views(set));
  const auto sets = golden<int>(set, "out_sets");
  const auto scores = golden<double>(set, reference_scores);
  int different = 0;
  for (std::size_t k = 0; k < sets.rows(); ++k) {
    EightPairs sample;
    for (std::size_t i = 0; i < 8; ++i) sample[i] = sets.at(k, i);
    const double score = data.best({sample}).score;
    different += std::abs(score - scores.at(k)) > 1e-3 * std::max(1.0, scores.at(k)) ? 1 : 0;
  }
  return different;
}

}  // namespace orbslam::testing
