// SPDX-License-Identifier: BSD-3-Clause
// Sizes, parts, repeats, aborts and errors of pose graphs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <thread>

#include "base/errors.hpp"
#include "pose_graphs.hpp"

namespace orbslam {
namespace {

using testing::distance;
using testing::drift;
using testing::random_tangent;
using testing::same_bytes;
using testing::walk;
using testing::worst;

TEST(OptimizePoseGraph, IterationsAreLimited) {
  const PoseGraph start = [] {
    PoseGraph graph = walk(60, 4, 0.02, 0.05);
    drift(graph, 4, 0.1, 0.3, 0.05);
    return graph;
  }();
  PoseGraphOptions options;
  double cost = std::numeric_limits<double>::infinity();
  for (const int iterations : {0, 1, 2, 3}) {
    PoseGraph graph = start;
    options.iterations = iterations;
    const PoseGraphSummary summary = optimize_pose_graph(graph, options, nullptr);
    EXPECT_EQ(summary.iterations, iterations);
    EXPECT_EQ(same_bytes(graph.S_iw, start.S_iw), iterations == 0);
    EXPECT_LT(summary.final_cost, cost);
    cost = summary.final_cost;
  }
}

TEST(OptimizePoseGraph, RepeatsBitByBit) {
  for (const bool fix_scale : {false, true}) {
    PoseGraphOptions options;
    options.fix_scale = fix_scale;
    PoseGraph start = walk(300, 6, 0.01, 0.02);
    drift(start, 6, 0.01, 0.1, 0.02);
    PoseGraph first = start;
    optimize_pose_graph(first, options, nullptr);
    for (int repeat = 0; repeat < 3; ++repeat) {
      PoseGraph again = start;
      optimize_pose_graph(again, options, nullptr);
      EXPECT_TRUE(same_bytes(first.S_iw, again.S_iw));
    }
  }
}

TEST(OptimizePoseGraph, TinyGraphs) {
  PoseGraph single;
  single.S_iw.resize(1);
  single.fixed = {1};
  EXPECT_EQ(optimize_pose_graph(single, {}, nullptr).final_cost, 0);

  PoseGraph pair;
  std::mt19937_64 random(8);
  const Similarity S_ji = Similarity::exp(random_tangent(random, 2.5, 10, 3));
  pair.S_iw.resize(2);
  pair.fixed = {1, 1};
  pair.edges.push_back({0, 1, S_ji});
  const PoseGraphSummary held = optimize_pose_graph(pair, {}, nullptr);
  EXPECT_EQ(held.final_cost, S_ji.log().squaredNorm());
  EXPECT_EQ(held.iterations, 0);
  pair.fixed = {1, 0};
  optimize_pose_graph(pair, {}, nullptr);
  EXPECT_LT(distance(pair.S_iw[1], S_ji), 1e-9);
  EXPECT_EQ(distance(pair.S_iw[0], Similarity()), 0);
}

TEST(OptimizePoseGraph, LargeGraphs) {
  PoseGraph graph = walk(5000, 7, 0.001, 0);
  const std::vector<Similarity> truth = graph.S_iw;
  drift(graph, 7, 1e-4, 1e-2, 1e-3);
  optimize_pose_graph(graph, {}, nullptr);
  EXPECT_LT(worst(graph.S_iw, truth), 1e-6);
}

TEST(OptimizePoseGraph, PartsWithoutAFixedVertexHoldTheirFirst) {
  std::mt19937_64 random(9);
  PoseGraph graph;
  for (int i = 0; i < 7; ++i) {
    graph.S_iw.push_back(Similarity::exp(random_tangent(random, 1, 3, 0.5)));
  }
  graph.fixed = {0, 0, 0, 1, 0, 0, 0};
  const std::vector<Similarity> start = graph.S_iw;
  const Similarity S_ji = Similarity::exp(random_tangent(random, 0.3, 1, 0.2));
  graph.edges = {{3, 4, S_ji}, {6, 5, S_ji}, {6, 1, S_ji}};  // 0 and 2 have none
  optimize_pose_graph(graph, {}, nullptr);
  for (const std::size_t i : {0U, 1U, 2U, 3U}) EXPECT_EQ(distance(graph.S_iw[i], start[i]), 0);
  EXPECT_LT(distance(graph.S_iw[4], S_ji * start[3]), 1e-9);
  EXPECT_LT(distance(graph.S_iw[6], S_ji.inverse() * start[1]), 1e-9);
  EXPECT_LT(distance(graph.S_iw[5], start[1]), 1e-9);
}

TEST(OptimizePoseGraph, RaisedFlagChangesNothing) {
  PoseGraph graph = walk(50, 10, 0.02, 0.02);
  drift(graph, 10, 0.02, 0.1, 0.02);
  const std::vector<Similarity> start = graph.S_iw;
  const std::atomic<bool> abort{true};
  const PoseGraphSummary summary = optimize_pose_graph(graph, {}, &abort);
  EXPECT_TRUE(summary.aborted);
  EXPECT_EQ(summary.iterations, 0);
  EXPECT_GT(summary.initial_cost, 0);
  EXPECT_EQ(summary.final_cost, summary.initial_cost);
  EXPECT_TRUE(same_bytes(graph.S_iw, start));
}

TEST(OptimizePoseGraph, FlagRaisedDuringTheWorkLeavesTheVerticesAsTheyWere) {
  PoseGraph start = walk(400, 11, 0.01, 0.02);
  drift(start, 11, 0.02, 0.2, 0.02);
  for (int delay = 0; delay < 12; ++delay) {
    PoseGraph graph = start;
    std::atomic<bool> abort{false};
    std::thread other([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(3 * delay));
      abort = true;
    });
    const PoseGraphSummary summary = optimize_pose_graph(graph, {}, &abort);
    other.join();
    EXPECT_EQ(summary.aborted, same_bytes(graph.S_iw, start.S_iw));
    EXPECT_EQ(summary.aborted, summary.final_cost == summary.initial_cost);
  }
}

void expect_state_error(PoseGraph graph, const std::string& part) {
  const std::vector<Similarity> start = graph.S_iw;
  try {
    optimize_pose_graph(graph, {}, nullptr);
    ADD_FAILURE() << "no StateError about " << part;
  } catch (const StateError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr(part));
  }
  EXPECT_TRUE(same_bytes(graph.S_iw, start));
}

TEST(OptimizePoseGraph, RefusesWhatMakesNoSense) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const PoseGraph good = walk(10, 12, 0.02, 0.02);
  PoseGraph bad = good;
  bad.fixed[0] = 0;
  expect_state_error(bad, "no vertex is fixed");
  bad = good;
  bad.fixed.pop_back();
  expect_state_error(bad, "10 vertices but 9 flags");
  bad = good;
  bad.edges[3].j = 10;
  expect_state_error(bad, "edge 3");
  bad = good;
  bad.edges[4].i = bad.edges[4].j;
  expect_state_error(bad, "edge 4");
  for (const Similarity& broken : {Similarity(1, Eigen::Quaterniond::Identity(), {0, nan, 0}),
                                   Similarity(1, Eigen::Quaterniond(1, 0, nan, 0), {0, 0, 0}),
                                   Similarity(1, Eigen::Quaterniond::Identity(), {0, 0, HUGE_VAL}),
                                   Similarity(1e-300, Eigen::Quaterniond::Identity(), {0, 0, 0})}) {
    bad = good;
    bad.S_iw[7] = broken;
    expect_state_error(bad, "vertex 7 is not finite");
    bad = good;
    bad.edges[2].S_ji = broken;
    expect_state_error(bad, "edge 2");
  }
}

}  // namespace
}  // namespace orbslam
