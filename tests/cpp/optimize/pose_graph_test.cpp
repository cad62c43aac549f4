// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/pose_graph.hpp"

#include <ceres/ceres.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <unsupported/Eigen/MatrixFunctions>
#include <utility>

#include "pose_graphs.hpp"

namespace orbslam {
namespace {

using testing::distance;
using testing::drift;
using testing::walk;
using testing::worst;

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
      EXPECT_LT(summary.final_cost, 1e-16);
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
struct OracleOfLogarithms {
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
    auto* cost = new ceres::DynamicNumericDiffCostFunction<OracleOfLogarithms, ceres::CENTRAL>(
        new OracleOfLogarithms{e.S_ji, graph.S_iw[e.i], graph.S_iw[e.j], fix_scale},
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

TEST(OptimizePoseGraph, UprightCamerasKeepRollAndPitch) {
  PoseGraph graph = walk(80, 4, 0, 0);
  const std::vector<Similarity> truth = graph.S_iw;
  // Errors of yaw and place that grow along the walk.
  std::mt19937_64 random(4);
  Similarity error;
  for (std::size_t i = 1; i < graph.S_iw.size(); ++i) {
    Vector7d step = testing::random_tangent(random, 0, 0.1, 0);
    step(2) = testing::uniform(random, -0.03, 0.03);
    error = Similarity::exp(step) * error;
    graph.S_iw[i] = graph.S_iw[i] * error;
  }
  PoseGraph tilted = graph;
  PoseGraphOptions options;
  options.upright = true;
  optimize_pose_graph(graph, options, nullptr);
  EXPECT_LT(worst(graph.S_iw, truth), 1e-9);
  // A measurement that contradicts gravity turns no camera about another axis.
  Vector7d off = Vector7d::Zero();
  off(0) = 0.2;
  tilted.edges.back().S_ji = Similarity::exp(off) * tilted.edges.back().S_ji;
  const std::vector<Similarity> before = tilted.S_iw;
  EXPECT_GT(optimize_pose_graph(tilted, options, nullptr).iterations, 0);
  for (std::size_t i = 0; i < before.size(); ++i) {
    const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
    EXPECT_LT((tilted.S_iw[i].rotation() * up - before[i].rotation() * up).norm(), 1e-12);
    EXPECT_EQ(tilted.S_iw[i].scale(), 1);
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

}  // namespace
}  // namespace orbslam
