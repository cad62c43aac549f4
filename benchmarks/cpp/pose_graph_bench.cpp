// SPDX-License-Identifier: BSD-3-Clause
// Pose graphs of one round trip that drifts in position, rotation and scale: every keyframe is tied
// to its three to six predecessors, and the last thirty to the start by a loop. One thread.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "measure.hpp"
#include "optimize/pose_graph.hpp"

namespace {

using namespace orbslam;

double uniform(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * static_cast<double>(random() >> 11) * 0x1.0p-53;
}

/// The essential graph right after a loop was found: keyframes near the last one are corrected, all
/// other edges still measure the drifted poses.
PoseGraph round_trip(std::uint32_t n) {
  constexpr std::uint32_t kLoop = 30, kCorrected = 15;
  std::mt19937_64 random(n);
  std::vector<Similarity> S_iw(n), S_true(n);  // with drift and without
  const double turn = 2 * M_PI / n, stride = 0.3, lost_scale = 0.5;
  Vector7d step, drifted;
  step << 0, -turn, 0, 0, 0, -stride, 0;
  double scale = 1;  // lengths here over true lengths
  for (std::uint32_t i = 1; i < n; ++i) {
    scale = std::exp(-lost_scale * i / n);
    drifted = step;
    for (int k = 0; k < 3; ++k) drifted(k) += 0.2 / n + uniform(random, -5e-4, 5e-4);
    for (int k = 3; k < 6; ++k) drifted(k) += uniform(random, -5e-3, 5e-3);
    drifted.segment<3>(3) *= scale;
    S_true[i] = Similarity::exp(step) * S_true[i - 1];
    S_iw[i] = Similarity::exp(drifted) * S_iw[i - 1];
  }
  // What the loop says: the last camera is where it was in truth, and sees lengths of its own.
  const Similarity S_loop =
      Similarity(scale, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()) * S_true[n - 1];

  PoseGraph graph;
  const auto add_edge = [&](std::uint32_t i, std::uint32_t j, const std::vector<Similarity>& S) {
    graph.edges.push_back({i, j, S[j] * S[i].inverse()});
  };
  for (std::uint32_t i = 1; i < n; ++i) {
    const std::uint32_t neighbours = 3 + static_cast<std::uint32_t>(random() % 4);
    for (std::uint32_t k = 1; k <= std::min(i, neighbours); ++k) add_edge(i, i - k, S_iw);
  }
  graph.S_iw = S_iw;
  graph.fixed.assign(n, 0);
  graph.fixed[0] = 1;
  for (std::uint32_t i = n - kCorrected; i < n; ++i) {
    graph.S_iw[i] = S_iw[i] * S_iw[n - 1].inverse() * S_loop;
  }
  for (std::uint32_t k = 0; k < kLoop; ++k) {
    add_edge(n - 1 - k / 2, k - k / 2, graph.S_iw);
  }
  return graph;
}

void BM_OptimizePoseGraph(benchmark::State& state) {
  const PoseGraph start = round_trip(static_cast<std::uint32_t>(state.range(0)));
  PoseGraphOptions options;
  options.fix_scale = state.range(1) != 0;
  options.eigen_cholesky = state.range(2) != 0;
  PoseGraphSummary summary;
  measure_prepared(
      state, [&] { return start; },
      [&](PoseGraph& graph) { summary = optimize_pose_graph(graph, options, nullptr); });
  state.counters["iterations"] = summary.iterations;
  state.counters["cost_before"] = summary.initial_cost;
  state.counters["cost_after"] = summary.final_cost;
}
BENCHMARK(BM_OptimizePoseGraph)
    ->ArgNames({"keyframes", "fix_scale", "eigen"})
    ->ArgsProduct({kMapSizes, {0, 1}, {0, 1}})
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
