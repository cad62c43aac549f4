// SPDX-License-Identifier: BSD-3-Clause
// Planning and applying the correction of a loop in maps of 60 points per keyframe, each seen by
// about 16 keyframes: milliseconds of both, and the longest time that a reader and a writer of the
// map had to wait meanwhile.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <thread>

#include "loops/loop_correction.hpp"
#include "loops/ring_scene.hpp"

namespace orbslam {
namespace {

using testing::RingOptions;
using testing::RingScene;
using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

std::unique_ptr<RingScene> make_scene(int n_keyframes, bool monocular) {
  RingOptions options;
  options.monocular = monocular;
  options.extra = 30;
  options.per_lap = n_keyframes - options.extra;
  options.points_per_step = 60;
  options.radius = 0.5 * options.per_lap / 6.28;  // half a metre between keyframes
  options.half_view = 320;
  options.turn_drift = 0.05 / n_keyframes;
  options.log_scale_drift = monocular ? 0.2 / n_keyframes : 0;
  return std::make_unique<RingScene>(options);
}

/// Takes a lock again and again; tells the longest time that it took.
template <class Lock>
class Waiting {
 public:
  explicit Waiting(const Lock& lock)
      : thread_([this, lock] {
          while (!stop_) {
            const auto begin = Clock::now();
            { const auto held = lock(); }
            longest_ = std::max(longest_, milliseconds_since(begin));
            started_ = true;
            std::this_thread::sleep_for(std::chrono::microseconds(200));
          }
        }) {
    while (!started_) std::this_thread::yield();
  }
  double finish() {
    stop_ = true;
    thread_.join();
    return longest_;
  }

 private:
  std::atomic<bool> stop_{false}, started_{false};
  double longest_ = 0;
  std::thread thread_;
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

void BM_CorrectLoop(benchmark::State& state) {
  std::vector<double> plan, apply, reader, writer;
  std::size_t points = 0, edges = 0, fusions = 0, group = 0;
  int repetition = 0;
  for (auto iteration : state) {
    static_cast<void>(iteration);
    const auto scene = make_scene(static_cast<int>(state.range(0)), state.range(1) != 0);
    Map& map = scene->map;
    points = map.n_points();
    const bool reading = repetition++ % 2 == 0;
    const auto run = [&](const auto& lock, std::vector<double>& longest) {
      Waiting waiting(lock);
      auto begin = Clock::now();
      LoopCorrection correction = plan_loop_correction(map, scene->loop, state.range(1) == 0);
      plan.push_back(milliseconds_since(begin));
      edges = correction.graph.edges.size();
      fusions = correction.fusions.size();
      group = correction.group.size();
      optimize_essential_graph(correction, nullptr);
      begin = Clock::now();
      apply_loop_correction(map, correction);
      apply.push_back(milliseconds_since(begin));
      longest.push_back(waiting.finish());
    };
    if (reading) {
      run([&map] { return map.read_lock(); }, reader);
    } else {
      run([&map] { return map.write_lock(); }, writer);
    }
    state.SetIterationTime(1e-3 * (plan.back() + apply.back()));
  }
  state.counters["plan_ms"] = median(plan);
  state.counters["apply_ms"] = median(apply);
  state.counters["reader_waits_ms"] = median(reader);
  if (!writer.empty()) state.counters["writer_waits_ms"] = median(writer);
  state.counters["points"] = static_cast<double>(points);
  state.counters["edges"] = static_cast<double>(edges);
  state.counters["fusions"] = static_cast<double>(fusions);
  state.counters["group"] = static_cast<double>(group);
}
BENCHMARK(BM_CorrectLoop)
    ->ArgNames({"keyframes", "monocular"})
    ->ArgsProduct({{250, 500, 1000, 2000, 4000}, {0, 1}})
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond)
    ->Iterations(6);

}  // namespace
}  // namespace orbslam
