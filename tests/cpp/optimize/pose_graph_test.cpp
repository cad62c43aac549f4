// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/pose_graph.hpp"

#include <ceres/ceres.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <thread>
#include <unsupported/Eigen/MatrixFunctions>

#include "base/errors.hpp"

namespace orbslam {
namespace {

double uniform(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * static_cast<double>(random() >> 11) * 0x1.0p-53;
}

Vector7d random_tangent(std::mt19937_64& random, double rotation, double translation,
                        double log_scale) {
  Vector7d delta;
  for (int i = 0; i < 3; ++i) delta(i) = uniform(random, -rotation, rotation);
  for (int i = 3; i < 6; ++i) delta(i) = uniform(random, -translation, translation);
  delta(6) = uniform(random, -log_scale, log_scale);
  return delta;
}

double distance(const Similarity& a, const Similarity& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff();
}

double worst(const std::vector<Similarity>& a, const std::vector<Similarity>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, distance(a[i], b[i]));
  return largest;
}

/// Also of numbers that are not equal to themselves; between numbers there may be padding.
bool same_bytes(const std::vector<Similarity>& a, const std::vector<Similarity>& b) {
  const auto numbers = [](const std::vector<Similarity>& values) {
    Eigen::Matrix<double, 8, Eigen::Dynamic> all(8, static_cast<Eigen::Index>(values.size()));
    for (std::size_t i = 0; i < values.size(); ++i) {
      all.col(static_cast<Eigen::Index>(i)) << values[i].rotation().coeffs(),
          values[i].translation(), values[i].scale();
    }
    return all;
  };
  const auto x = numbers(a), y = numbers(b);
  return x.size() == y.size() &&
         std::memcmp(x.data(), y.data(), static_cast<std::size_t>(x.size()) * sizeof(double)) == 0;
}

/// n vertices in a ring, chained by the same measured motion, and a closing edge from the last to
/// the first. The chain starts where the measurements say, so that the closing edge bears all.
PoseGraph ring(std::uint32_t n, const Similarity& motion, const Similarity& closing) {
  PoseGraph graph;
  graph.S_iw.assign(n, Similarity());
  graph.fixed.assign(n, 0);
  graph.fixed[0] = 1;
  for (std::uint32_t i = 0; i + 1 < n; ++i) {
    graph.S_iw[i + 1] = motion * graph.S_iw[i];
    graph.edges.push_back({i, i + 1, motion});
  }
  graph.edges.push_back({n - 1, 0, closing});
  return graph;
}

Similarity along(const Vector7d& direction, double amount) {
  return Similarity::exp(amount * direction);
}

Vector7d direction(double turn, double forward, double log_scale) {
  Vector7d delta;
  delta << 0, 0, turn, 0, 0, forward, log_scale;
  return delta;
}

/// In a ring of motions along one direction d the measured amounts a and the closing amount c add
/// up to an error that every edge bears alike: vertex i is at exp(i (a - e / n) d), e the sum. That
/// is a minimum where the residual's own Jacobian leaves it alone: for turns about an axis with
/// shifts along it when scales are kept, for turns with changes of scale, and for either alone.
void expect_even_distribution(std::uint32_t n, const Vector7d& d, bool fix_scale, double error) {
  const double amount = 1.0 / n;
  PoseGraph graph = ring(n, along(d, amount), along(d, amount - 1 + error));
  PoseGraphOptions options;
  options.fix_scale = fix_scale;
  const PoseGraphSummary summary = optimize_pose_graph(graph, options, nullptr);
  std::vector<Similarity> expected;
  for (std::uint32_t i = 0; i < n; ++i) expected.push_back(along(d, i * (amount - error / n)));
  EXPECT_LT(worst(graph.S_iw, expected), 1e-11) << n << " vertices, direction " << d.transpose();
  EXPECT_NEAR(summary.initial_cost, d.squaredNorm() * error * error, 1e-11);
  EXPECT_NEAR(summary.final_cost, d.squaredNorm() * error * error / n, 1e-12);
}

TEST(OptimizePoseGraph, RingOfTranslationsSharesTheErrorEvenly) {
  for (const std::uint32_t n : {2U, 3U, 10U, 1000U}) {
    expect_even_distribution(n, direction(0, 20, 0), true, 0.1);
  }
}

TEST(OptimizePoseGraph, RingOfTurnsSharesTheErrorEvenly) {
  for (const std::uint32_t n : {3U, 10U, 1000U}) {
    expect_even_distribution(n, direction(2, 0, 0), true, 0.2);
    expect_even_distribution(n, direction(2, 0, 0), false, 0.2);
    expect_even_distribution(n, direction(2, 5, 0), true, 0.2);
  }
}

TEST(OptimizePoseGraph, RingOfScalesSharesTheErrorEvenly) {
  for (const std::uint32_t n : {2U, 3U, 10U, 1000U}) {
    expect_even_distribution(n, direction(0, 0, 2), false, 0.3);
    expect_even_distribution(n, direction(1, 0, 2), false, 0.3);
  }
}

/// A walk of n vertices in the manner of keyframes: each tied to some of those before, the last to
/// the first ones. `noise` spoils the measurements.
PoseGraph walk(std::uint32_t n, std::uint64_t seed, double log_scale, double noise) {
  std::mt19937_64 random(seed);
  PoseGraph graph;
  graph.S_iw.resize(n);
  graph.fixed.assign(n, 0);
  graph.fixed[0] = 1;
  const double turn = 6.0 / n;
  for (std::uint32_t i = 1; i < n; ++i) {
    Vector7d step = random_tangent(random, 0.05, 0.1, log_scale);
    step(1) -= turn;
    step(5) -= 0.3;
    graph.S_iw[i] = Similarity::exp(step) * graph.S_iw[i - 1];
  }
  const auto measure = [&](std::uint32_t i, std::uint32_t j) {
    const Vector7d error = random_tangent(random, noise, noise, log_scale > 0 ? noise : 0.0);
    graph.edges.push_back({i, j, Similarity::exp(error) * graph.S_iw[j] * graph.S_iw[i].inverse()});
  };
  for (std::uint32_t i = 1; i < n; ++i) {
    measure(i, i - 1);
    for (std::uint32_t k = 2; k < 6; ++k) {
      if (k <= i && random() % 2 == 0) measure(i, i - k);
    }
  }
  for (std::uint32_t k = 0; k < std::min(5U, n / 4); ++k) measure(n - 1 - k, k);
  return graph;
}

/// Lets every vertex's error grow along the walk.
void drift(PoseGraph& graph, std::uint64_t seed, double rotation, double translation,
           double log_scale) {
  std::mt19937_64 random(seed);
  Similarity error;
  for (std::size_t i = 0; i < graph.S_iw.size(); ++i) {
    if (graph.fixed[i] != 0) continue;
    error = Similarity::exp(random_tangent(random, rotation, translation, log_scale)) * error;
    graph.S_iw[i] = graph.S_iw[i] * error;
  }
}

TEST(OptimizePoseGraph, ConsistentMeasurementsAreRecoveredExactly) {
  for (const bool fix_scale : {false, true}) {
    for (std::uint64_t seed = 0; seed < 10; ++seed) {
      PoseGraph graph = walk(100, seed, fix_scale ? 0.0 : 0.02, 0);
      const std::vector<Similarity> truth = graph.S_iw;
      drift(graph, seed, 0.03, 0.3, fix_scale ? 0.0 : 0.05);
      ASSERT_GT(worst(graph.S_iw, truth), 1);
      PoseGraphOptions options;
      options.fix_scale = fix_scale;
      const PoseGraphSummary summary = optimize_pose_graph(graph, options, nullptr);
      EXPECT_LT(worst(graph.S_iw, truth), 1e-9) << "seed " << seed;
      EXPECT_LT(summary.final_cost, 1e-18);
      EXPECT_GT(summary.initial_cost, 1e-2);
    }
  }
}

TEST(OptimizePoseGraph, StartingAtTheOptimumChangesNothingThatMatters) {
  PoseGraph graph = walk(100, 1, 0.02, 0);
  const std::vector<Similarity> truth = graph.S_iw;
  const PoseGraphSummary summary = optimize_pose_graph(graph, {}, nullptr);
  EXPECT_LE(summary.iterations, 1);
  EXPECT_LT(worst(graph.S_iw, truth), 1e-12);
}

TEST(OptimizePoseGraph, FixedVerticesAndScalesStay) {
  PoseGraph graph = walk(60, 2, 0.02, 0.01);
  graph.fixed[30] = 1;
  drift(graph, 2, 0.02, 0.1, 0.05);
  const PoseGraph start = graph;
  PoseGraphOptions options;
  options.fix_scale = true;
  optimize_pose_graph(graph, options, nullptr);
  for (std::size_t i = 0; i < graph.S_iw.size(); ++i) {
    EXPECT_EQ(graph.S_iw[i].scale(), start.S_iw[i].scale());
    EXPECT_EQ(distance(graph.S_iw[i], start.S_iw[i]) == 0, graph.fixed[i] != 0);
  }
}

/// The residual by Eigen's logarithm of 4x4 matrices, which is [[omega]x + sigma I, upsilon; 0, 0],
/// to be differentiated numerically.
struct OracleResidual {
  Similarity S_ji, S_iw, S_jw;
  bool fix_scale;

  Similarity moved(const Similarity& start, const double* x) const {
    Vector7d delta = Vector7d::Zero();
    std::copy_n(x, fix_scale ? 6 : 7, delta.data());
    return Similarity::exp(delta) * start;
  }
  bool operator()(double const* const* x, double* residual) const {
    const Eigen::Matrix4d E =
        S_ji.matrix() * moved(S_iw, x[0]).matrix() * moved(S_jw, x[1]).matrix().inverse();
    const Eigen::Matrix4d L = E.log();
    residual[0] = (L(2, 1) - L(1, 2)) / 2;
    residual[1] = (L(0, 2) - L(2, 0)) / 2;
    residual[2] = (L(1, 0) - L(0, 1)) / 2;
    for (int i = 0; i < 3; ++i) residual[3 + i] = L(i, 3);
    residual[6] = (L(0, 0) + L(1, 1) + L(2, 2)) / 3;
    return true;
  }
};

/// Returns the vertices at the optimum and its sum of squares.
std::pair<std::vector<Similarity>, double> solve_with_oracle(const PoseGraph& graph,
                                                             bool fix_scale) {
  const int n = fix_scale ? 6 : 7;
  std::vector<Vector7d> x(graph.S_iw.size(), Vector7d::Zero());
  ceres::Problem problem;
  ceres::NumericDiffOptions steps;
  steps.relative_step_size = 1e-5;
  for (const PoseGraph::Edge& e : graph.edges) {
    auto* cost = new ceres::DynamicNumericDiffCostFunction<OracleResidual, ceres::CENTRAL>(
        new OracleResidual{e.S_ji, graph.S_iw[e.i], graph.S_iw[e.j], fix_scale},
        ceres::TAKE_OWNERSHIP, steps);
    cost->AddParameterBlock(n);
    cost->AddParameterBlock(n);
    cost->SetNumResiduals(7);
    problem.AddResidualBlock(cost, nullptr, x[e.i].data(), x[e.j].data());
  }
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (graph.fixed[i] != 0) problem.SetParameterBlockConstant(x[i].data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 200;
  options.function_tolerance = options.gradient_tolerance = 1e-14;
  options.parameter_tolerance = 1e-12;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  std::vector<Similarity> S_iw;
  for (std::size_t i = 0; i < x.size(); ++i) {
    S_iw.push_back(Similarity::exp(x[i]) * graph.S_iw[i]);
  }
  return {S_iw, 2 * summary.final_cost};
}

TEST(OptimizePoseGraph, AgreesWithNumericallyDifferentiatedMatrixLogarithms) {
  for (const bool fix_scale : {false, true}) {
    for (std::uint64_t seed = 0; seed < 4; ++seed) {
      PoseGraph graph = walk(25, seed, 0.02, 0.05);
      drift(graph, seed, 0.1, 0.2, 0.03);
      const auto [expected, cost] = solve_with_oracle(graph, fix_scale);
      PoseGraphOptions options;
      options.fix_scale = fix_scale;
      const PoseGraphSummary summary = optimize_pose_graph(graph, options, nullptr);
      EXPECT_GT(cost, 1e-3);
      EXPECT_NEAR(summary.final_cost, cost, 1e-11 * cost) << "seed " << seed;
      EXPECT_LT(worst(graph.S_iw, expected), 1e-6) << "seed " << seed;
    }
  }
}

TEST(OptimizePoseGraph, CostsAreSumsOverAllEdges) {
  PoseGraph graph = walk(30, 3, 0.02, 0.02);
  graph.fixed[10] = graph.fixed[11] = 1;  // the edge between the two counts as well
  drift(graph, 3, 0.02, 0.1, 0.02);
  const auto cost = [&] {
    double sum = 0;
    for (const PoseGraph::Edge& e : graph.edges) {
      sum += (e.S_ji * graph.S_iw[e.i] * graph.S_iw[e.j].inverse()).log().squaredNorm();
    }
    return sum;
  };
  const double before = cost();
  const PoseGraphSummary summary = optimize_pose_graph(graph, {}, nullptr);
  EXPECT_NEAR(summary.initial_cost, before, 1e-12 * before);
  EXPECT_NEAR(summary.final_cost, cost(), 1e-12 * cost());
  EXPECT_LT(summary.final_cost, summary.initial_cost);
}

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

TEST(OptimizePoseGraph, SuiteSparseAndEigenAgree) {
  PoseGraph graph = walk(200, 5, 0.02, 0.03);
  drift(graph, 5, 0.02, 0.1, 0.02);
  PoseGraph other = graph;
  PoseGraphOptions options;
  optimize_pose_graph(graph, options, nullptr);
  options.eigen_cholesky = true;
  optimize_pose_graph(other, options, nullptr);
  EXPECT_LT(worst(graph.S_iw, other.S_iw), 1e-8);
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

TEST(OptimizePoseGraph, LargeGraphs) {
  PoseGraph graph = walk(5000, 7, 0.001, 0);
  const std::vector<Similarity> truth = graph.S_iw;
  drift(graph, 7, 1e-4, 1e-2, 1e-3);
  optimize_pose_graph(graph, {}, nullptr);
  EXPECT_LT(worst(graph.S_iw, truth), 1e-6);
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
