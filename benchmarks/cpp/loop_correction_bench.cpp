// SPDX-License-Identifier: BSD-3-Clause
// Planning and applying the correction of a loop in maps of 60 points per keyframe, each seen by
// about 16 keyframes. Applying is told apart into what is done under the read lock (prepare) and
// under the write lock (write). Median and least milliseconds of processor time over six maps.
#include <benchmark/benchmark.h>

#include <memory>
#include <vector>

#include "loops/prepared_correction.hpp"
#include "loops/ring_scene.hpp"
#include "measure.hpp"

namespace orbslam {
namespace {

using testing::RingOptions;
using testing::RingScene;

/// Processor time of this thread.
double milliseconds() { return milliseconds_of(CLOCK_THREAD_CPUTIME_ID); }

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

void BM_CorrectLoop(benchmark::State& state) {
  std::vector<double> plan, prepare, write;
  for (auto iteration : state) {
    static_cast<void>(iteration);
    const auto scene = make_scene(static_cast<int>(state.range(0)), state.range(1) != 0);
    Map& map = scene->map;
    double begin = milliseconds();
    const LoopCorrection correction = plan_loop_correction(map, scene->loop, state.range(1) == 0);
    plan.push_back(milliseconds() - begin);
    begin = milliseconds();
    const PreparedCorrection prepared(map, correction);  // nobody else uses the map: no locks
    prepare.push_back(milliseconds() - begin);
    begin = milliseconds();
    const LoopCorrectionResult result = prepared.commit(map);
    write.push_back(milliseconds() - begin);
    state.SetIterationTime(1e-3 * (plan.back() + prepare.back() + write.back()));
    state.counters["points"] = static_cast<double>(correction.carried.size());
    state.counters["edges"] = static_cast<double>(correction.graph.edges.size());
    state.counters["fused"] = result.n_fused;
    state.counters["group"] = static_cast<double>(correction.group.size());
  }
  report_times(state, plan, "plan_");
  report_times(state, prepare, "prepare_");
  report_times(state, write, "write_");
}
BENCHMARK(BM_CorrectLoop)
    ->ArgNames({"keyframes", "monocular"})
    ->ArgsProduct({kMapSizes, {0, 1}})
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond)
    ->Iterations(6);

}  // namespace
}  // namespace orbslam
