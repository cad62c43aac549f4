// SPDX-License-Identifier: BSD-3-Clause
// What loop detection does with every keyframe, by size of the map: the lowest score among its
// neighbours, the query of the index, consistency, and its own entry into the index.
//
// Words are made up so that they are shared as in photographs (1000 features, the package's 10^5
// words): two images of different places have 4 % of their words in common, neighbours 13 %.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "keyframe_ring.hpp"
#include "loops/loop_detection.hpp"
#include "measure.hpp"
#include "places/place_recognition.hpp"

namespace orbslam {
namespace {

constexpr std::uint32_t kWords = 100000;  // of the vocabulary

/// Words of an image at a place. A tenth belongs to the place, each for 30 places in a row; others
/// are frequent and rare ones at random.
WordVector words_at(std::int64_t place, std::uint64_t seed) {
  constexpr std::int64_t kOfPlace = 100, kOthers = 880, kPlaces = 30;
  std::vector<std::uint32_t> words;
  for (std::int64_t i = 0; i < kOfPlace; ++i) {
    const std::int64_t stretch = (place + i * kPlaces / kOfPlace) / kPlaces;
    std::mt19937_64 random(static_cast<std::uint64_t>(stretch * kOfPlace + i));
    words.push_back(static_cast<std::uint32_t>(random() % kWords));
  }
  std::mt19937_64 random(seed);
  for (std::int64_t i = 0; i < kOthers; ++i) {
    const double rank = std::pow(testing::uniform(random), 2.6);
    words.push_back(static_cast<std::uint32_t>(rank * kWords));
  }
  std::sort(words.begin(), words.end());
  words.erase(std::unique(words.begin(), words.end()), words.end());
  WordVector vector;
  vector.weights.assign(words.size(), 1.0 / static_cast<double>(words.size()));
  vector.words = std::move(words);
  return vector;
}

/// The last keyframe has come back to the beginning, or to no place seen before.
struct Revisit : KeyFrameRing {
  Revisit(std::int64_t n, bool known)
      : KeyFrameRing(n, [n, known](std::int64_t k, Frame& frame) {
          const bool back = known && k >= n - 15;
          frame.words = words_at(back ? k - (n - 15) : k, static_cast<std::uint64_t>(k));
          frame.described = true;
        }) {
    for (std::int64_t k = 0; k + 1 < n; ++k) index_keyframe(index, map, KeyFrameId(k));
  }
  KeyFrameIndex index;
};

void BM_DetectLoop(benchmark::State& state) {
  const std::int64_t n = state.range(0);
  Revisit scene(n, state.range(1) != 0);
  const KeyFrameId last(n - 1);
  LoopConsistency consistency;
  std::size_t n_candidates = 0, n_consistent = 0;
  const auto unknown = [&] {
    scene.index.erase(last);
    return last;
  };
  measure_prepared(state, unknown, [&](KeyFrameId keyframe) {
    const double least_score = lowest_neighbour_score(scene.map, keyframe);
    std::vector<KeyFrameId> candidates;
    for (const auto& c : find_loop_candidates(scene.index, scene.map, keyframe, least_score)) {
      candidates.push_back(c.keyframe);
    }
    n_consistent = consistency.update(scene.map, candidates).size();
    index_keyframe(scene.index, scene.map, keyframe);
    n_candidates = candidates.size();
  });
  state.counters["candidates"] = static_cast<double>(n_candidates);
  state.counters["consistent"] = static_cast<double>(n_consistent);
  state.counters["words"] = static_cast<double>(scene.map.find(last)->frame->words.words.size());
}
BENCHMARK(BM_DetectLoop)
    ->ArgNames({"keyframes", "known"})
    ->ArgsProduct({kMapSizes, {0, 1}})
    ->UseManualTime()
    ->Iterations(300)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace orbslam
