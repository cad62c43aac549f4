// SPDX-License-Identifier: BSD-3-Clause
// Loops: verification of one candidate, and how far drift may have carried the map.
#include <benchmark/benchmark.h>

#include <vector>

#include "keyframe_ring.hpp"
#include "loops/loop_choice.hpp"
#include "loops/loop_scene.hpp"
#include "loops/loop_verification.hpp"
#include "measure.hpp"

namespace orbslam {
namespace {

/// About 1000 features per keyframe, of which the given percentage has moved since: they match by
/// words and are wrong.
struct WrongMatches : testing::TwiceMappedScene {
  explicit WrongMatches(std::int64_t percent)
      : TwiceMappedScene(testing::drift_by(0.2, 1), 1015, noisy()) {
    std::mt19937_64 random(1);
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (static_cast<std::int64_t>(i * 37 % 100) >= percent) continue;
      const double turn = testing::uniform(random, 0, 3), move = testing::uniform(random, 1, 5);
      displace(i, testing::drift_by(turn, move));
    }
  }
  static testing::ProjectionOptions noisy() {
    testing::ProjectionOptions options;
    options.pixel_noise = 1;
    options.flipped_bits = 15;
    return options;
  }
};

void BM_VerifyLoopCandidate(benchmark::State& state) {
  const WrongMatches scene(state.range(0));
  LoopVerificationOptions options;
  options.fix_scale = state.range(1) != 0;
  std::optional<Loop> loop;
  measure(state, [&] {
    ++options.seed;
    loop = verify_loop_candidate(scene.map, scene.kCurrent, scene.kMatched, options);
    benchmark::DoNotOptimize(loop);
  });
  state.counters["features"] =
      static_cast<double>(scene.map.find(scene.kCurrent)->map_points.size());
  state.counters["inliers"] = loop ? loop->n_inliers : 0;
}
BENCHMARK(BM_VerifyLoopCandidate)
    ->ArgNames({"percent_wrong", "fix_scale"})
    ->ArgsProduct({{0, 50, 80, 100}, {0, 1}})
    ->Unit(benchmark::kMillisecond);

void sizes_of_map(benchmark::internal::Benchmark* bench) {
  bench->ArgName("keyframes")->ArgsProduct({kMapSizes});
  bench->Iterations(100)->Unit(benchmark::kMillisecond);
}

void BM_AssessDrift(benchmark::State& state) {
  const KeyFrameRing ring(state.range(0));
  measure(state,
          [&] { benchmark::DoNotOptimize(assess_drift(ring.map, ring.loops.front(), true)); });
}
BENCHMARK(BM_AssessDrift)->Apply(sizes_of_map);

void BM_ChooseLoopOfEight(benchmark::State& state) {
  const KeyFrameRing ring(state.range(0));
  measure(state, [&] { benchmark::DoNotOptimize(choose_loop(ring.map, ring.loops, true)); });
}
BENCHMARK(BM_ChooseLoopOfEight)->Apply(sizes_of_map);

}  // namespace
}  // namespace orbslam
