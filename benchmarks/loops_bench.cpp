// SPDX-License-Identifier: BSD-3-Clause
// Loops: verification of one candidate, and how far drift may have carried the map.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

#include "loops/loop_choice.hpp"
#include "loops/loop_scene.hpp"
#include "loops/loop_verification.hpp"

namespace orbslam {
namespace {

/// Runs `work` and reports the median and the 99th percentile.
template <class Work>
void measure(benchmark::State& state, Work work) {
  std::vector<double> milliseconds;
  for (auto _ : state) {
    const auto begin = std::chrono::steady_clock::now();
    work();
    const std::chrono::duration<double, std::milli> taken =
        std::chrono::steady_clock::now() - begin;
    milliseconds.push_back(taken.count());
  }
  std::sort(milliseconds.begin(), milliseconds.end());
  state.counters["median_ms"] = milliseconds[milliseconds.size() / 2];
  state.counters["p99_ms"] = milliseconds[milliseconds.size() * 99 / 100];
}

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

/// A ring of keyframes, each covisible with the 15 before and the 15 after it.
struct Ring {
  explicit Ring(std::int64_t n) {
    constexpr std::int64_t kBefore = 15;
    constexpr std::size_t kShared = 15;
    const double step = 2 * 3.141592653589793 / static_cast<double>(n);
    for (std::int64_t k = 0; k < n; ++k) {
      const double angle = step * static_cast<double>(k);
      const double radius = 0.5 / step;
      const Eigen::Vector3d center(radius * std::cos(angle), 0, radius * std::sin(angle));
      const Eigen::Quaterniond R_wc(Eigen::AngleAxisd(-angle, Eigen::Vector3d::UnitY()));
      map.add_keyframe(testing::make_raster_frame(k, (kBefore + 1) * kShared, 5),
                       Pose(R_wc, center).inverse());
      map.publish(KeyFrameId(k));
    }
    // Points are seen by kBefore + 1 keyframes in a row; a keyframe's slot follows from who made
    // the point.
    for (std::int64_t k = 0; k + kBefore < n; ++k) {
      for (std::size_t i = 0; i < kShared; ++i) {
        const MapPointId id = map.add_point({0, 0, 5}, KeyFrameId(k), 0);
        for (std::int64_t j = k; j <= k + kBefore; ++j) {
          map.add_observation(id, KeyFrameId(j), static_cast<std::size_t>(j - k) * kShared + i);
        }
      }
    }
    for (std::int64_t k = 0; k < n; ++k) map.update_connections(KeyFrameId(k));
    for (std::int64_t matched = 0; matched < 8; ++matched) {
      Loop loop;
      loop.current = KeyFrameId(n - 1);
      loop.matched = KeyFrameId(matched);
      loop.S_cw = Similarity(map.T_cw(loop.current));
      loop.n_matches = 100;
      loops.push_back(loop);
    }
  }
  Map map;
  std::vector<Loop> loops;
};

void BM_AssessDrift(benchmark::State& state) {
  const Ring ring(state.range(0));
  measure(state,
          [&] { benchmark::DoNotOptimize(assess_drift(ring.map, ring.loops.front(), true)); });
}
BENCHMARK(BM_AssessDrift)
    ->ArgName("keyframes")
    ->Arg(250)
    ->Arg(1000)
    ->Arg(4000)
    ->Unit(benchmark::kMillisecond);

void BM_ChooseLoopOfEight(benchmark::State& state) {
  const Ring ring(state.range(0));
  measure(state, [&] { benchmark::DoNotOptimize(choose_loop(ring.map, ring.loops, true)); });
}
BENCHMARK(BM_ChooseLoopOfEight)
    ->ArgName("keyframes")
    ->Arg(250)
    ->Arg(1000)
    ->Arg(4000)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace orbslam
