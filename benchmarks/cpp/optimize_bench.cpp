// SPDX-License-Identifier: BSD-3-Clause
// Optimizers on the golden problems: 200 monocular and 350 mixed matches for a pose; 10 free and 5
// fixed keyframes, 1200 points and 9700 observations for a bundle. One thread.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <vector>

#include "measure.hpp"
#include "optimize/golden.hpp"

namespace {

using namespace orbslam;

void BM_OptimizePose(benchmark::State& state, const char* set) {
  const testing::PoseProblem problem = testing::golden_pose_problem(set);
  measure(state, [&] {
    benchmark::DoNotOptimize(
        optimize_pose(problem.T_cw_initial, *problem.camera, problem.observations));
  });
}
BENCHMARK_CAPTURE(BM_OptimizePose, mono_200, "poseopt_mono")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_OptimizePose, mixed_350, "poseopt_stereo")->Unit(benchmark::kMillisecond);

void BM_SolveBundle(benchmark::State& state, const char* set, BundleSolver solver) {
  const BundleProblem start = testing::golden_bundle(set).problem;
  BundleProblem problem;
  BundleOptions options;
  options.solver = solver;
  measure(state, [&] {
    problem = start;
    benchmark::DoNotOptimize(solve_bundle(problem, options, nullptr));
  });
}
BENCHMARK_CAPTURE(BM_SolveBundle, mono, "lba_mono", BundleSolver::kBlocks)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_SolveBundle, stereo, "lba_stereo", BundleSolver::kBlocks)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_SolveBundle, small, "lba_small", BundleSolver::kBlocks)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_SolveBundle, mono_ceres, "lba_mono", BundleSolver::kCeres)
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_SolveBundle, stereo_ceres, "lba_stereo", BundleSolver::kCeres)
    ->Unit(benchmark::kMillisecond);

}  // namespace
