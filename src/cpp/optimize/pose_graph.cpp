// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/pose_graph.hpp"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <string>

#include "base/errors.hpp"
#include "optimize/bundle_iterations.hpp"
#include "optimize/pose_graph_residuals.hpp"
#include "optimize/single_openmp_thread.hpp"

namespace orbslam {
namespace {

constexpr double kConverged = 1e-9;
constexpr int kTrials = 11;  // of a step: ten rejected ones and the one accepted

using Edge = PoseGraph::Edge;

bool usable(const Similarity& S) {
  return S.rotation().coeffs().allFinite() && S.translation().allFinite() &&
         std::abs(std::log(S.scale())) < kMaxLogScale;
}

void check(const PoseGraph& graph) {
  const std::size_t n = graph.S_iw.size();
  if (graph.fixed.size() != n) {
    throw StateError("optimize_pose_graph: " + std::to_string(n) + " vertices but " +
                     std::to_string(graph.fixed.size()) + " flags of fixed ones");
  }
  if (std::count(graph.fixed.begin(), graph.fixed.end(), 0) == static_cast<std::ptrdiff_t>(n)) {
    throw StateError("optimize_pose_graph: no vertex is fixed; fix the loop keyframe");
  }
  for (std::size_t i = 0; i < n; ++i) {
    if (usable(graph.S_iw[i])) continue;
    throw StateError("optimize_pose_graph: vertex " + std::to_string(i) +
                     " is not finite or its scale is out of range");
  }
  for (std::size_t k = 0; k < graph.edges.size(); ++k) {
    const Edge& e = graph.edges[k];
    const std::string name = "optimize_pose_graph: edge " + std::to_string(k) + " from vertex " +
                             std::to_string(e.i) + " to " + std::to_string(e.j);
    if (e.i >= n || e.j >= n) {
      throw StateError(name + ", but there are " + std::to_string(n) + " vertices");
    }
    if (e.i == e.j) throw StateError(name + " joins it to itself; leave it out");
    if (!usable(e.S_ji)) throw StateError(name + " is not finite or its scale is out of range");
  }
}

double total_cost(const PoseGraph& graph) {
  double sum = 0;
  for (const Edge& e : graph.edges) {
    sum += pose_graph_residual(e.S_ji, graph.S_iw[e.i], graph.S_iw[e.j]).squaredNorm();
  }
  return sum;
}

/// The fixed vertices, and the first vertex of every part of the graph without a fixed one, which
/// is fixed as well to determine the others.
std::vector<std::uint8_t> held_vertices(const PoseGraph& graph) {
  const std::size_t n = graph.S_iw.size();
  std::vector<std::size_t> first(n + 1, 0);  // neighbours of all vertices, one after the other
  for (const Edge& e : graph.edges) ++first[e.i + 1], ++first[e.j + 1];
  for (std::size_t i = 0; i < n; ++i) first[i + 1] += first[i];
  std::vector<std::size_t> neighbours(first[n]), end(first.begin(), first.end() - 1);
  for (const Edge& e : graph.edges) {
    neighbours[end[e.i]++] = e.j;
    neighbours[end[e.j]++] = e.i;
  }

  std::vector<std::uint8_t> held = graph.fixed, reached(n, 0);
  std::vector<std::size_t> queue;
  const auto reach_from = [&](std::size_t start) {
    if (reached[start] != 0) return;
    reached[start] = 1;
    queue.assign(1, start);
    while (!queue.empty()) {
      const std::size_t i = queue.back();
      queue.pop_back();
      for (std::size_t k = first[i]; k < first[i + 1]; ++k) {
        if (reached[neighbours[k]] != 0) continue;
        reached[neighbours[k]] = 1;
        queue.push_back(neighbours[k]);
      }
    }
  };
  for (std::size_t i = 0; i < n; ++i) {
    if (graph.fixed[i] != 0) reach_from(i);
  }
  for (std::size_t i = 0; i < n; ++i) {
    if (reached[i] != 0) continue;
    held[i] = 1;
    reach_from(i);
  }
  return held;
}

ceres::SparseLinearAlgebraLibraryType backend(const PoseGraphOptions& options) {
  return !options.eigen_cholesky &&
                 ceres::IsSparseLinearAlgebraLibraryTypeAvailable(ceres::SUITE_SPARSE)
             ? ceres::SUITE_SPARSE
             : ceres::EIGEN_SPARSE;
}

/// The Ceres problem of a graph.
template <int kParameters>
class PoseGraphSolver final : public ceres::EvaluationCallback {
 public:
  explicit PoseGraphSolver(const PoseGraph& graph)
      : parameters_(graph.S_iw.size() * kParameters, 0.0), problem_(problem_options(this)) {
    views_.reserve(graph.S_iw.size());
    for (const Similarity& S_iw : graph.S_iw) views_.emplace_back(S_iw);
    const std::vector<std::uint8_t> held = held_vertices(graph);
    for (const Edge& e : graph.edges) {
      if (held[e.i] != 0 && held[e.j] != 0) continue;
      problem_.AddResidualBlock(&residuals_.emplace_back(e.S_ji, &views_[e.i], &views_[e.j]),
                                nullptr, block(e.i), block(e.j));
    }
    for (std::size_t i = 0; i < held.size(); ++i) {
      if (!problem_.HasParameterBlock(block(i))) continue;
      if (held[i] != 0) {
        problem_.SetParameterBlockConstant(block(i));
      } else {
        free_.push_back(i);
      }
    }
  }

  void PrepareForEvaluation(bool, bool new_evaluation_point) override {
    if (new_evaluation_point) move();
  }

  void minimise(const PoseGraphOptions& options, BundleIterations& rules) {
    if (free_.empty()) return;
    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    solver.sparse_linear_algebra_library_type = backend(options);
    solver.max_num_iterations = kTrials * options.iterations;
    solver.max_num_consecutive_invalid_steps = kTrials;
    solver.initial_trust_region_radius = solver.max_trust_region_radius;  // Gauss-Newton
    solver.jacobi_scaling = false;
    // BundleIterations ends by the decrease of the cost. These limits end a minimisation whose cost
    // consists of rounding errors only, where no step is accepted any more.
    solver.function_tolerance = 0;
    solver.gradient_tolerance = 1e-12;
    solver.parameter_tolerance = 1e-10;
    solver.num_threads = std::max(1, options.n_threads);
    solver.logging_type = ceres::SILENT;
    solver.callbacks.push_back(&rules);
    ceres::Solver::Summary report;
    const SingleOpenMpThread single;
    ceres::Solve(solver, &problem_, &report);
  }

  /// Writes the result so far into the graph.
  void store(PoseGraph& graph) {
    move();
    for (const std::size_t i : free_) graph.S_iw[i] = views_[i].S_iw();
  }

 private:
  static ceres::Problem::Options problem_options(ceres::EvaluationCallback* callback) {
    ceres::Problem::Options options;
    options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.disable_all_safety_checks = true;
    options.evaluation_callback = callback;
    return options;
  }

  double* block(std::size_t vertex) { return parameters_.data() + vertex * kParameters; }
  void move() {
    for (const std::size_t i : free_) views_[i].move(block(i), kParameters);
  }

  std::vector<PoseGraphView> views_;
  std::vector<double> parameters_;
  std::vector<std::size_t> free_;  // neither held nor without edges
  std::deque<PoseGraphResidual<kParameters>> residuals_;
  ceres::Problem problem_;
};

template <int kParameters>
void minimise(PoseGraph& graph, const PoseGraphOptions& options, BundleIterations& rules) {
  PoseGraphSolver<kParameters> solver(graph);
  solver.minimise(options, rules);
  if (rules.successful() > 0 && !rules.aborted()) solver.store(graph);
}

}  // namespace

PoseGraphSummary optimize_pose_graph(PoseGraph& graph, const PoseGraphOptions& options,
                                     const std::atomic<bool>* abort) {
  check(graph);
  PoseGraphSummary summary;
  summary.initial_cost = summary.final_cost = total_cost(graph);
  summary.aborted = is_raised(abort);
  if (summary.aborted || options.iterations <= 0) return summary;
  BundleIterations rules(options.iterations, kConverged, abort);
  if (options.upright) {
    minimise<4>(graph, options, rules);
  } else if (options.fix_scale) {
    minimise<6>(graph, options, rules);
  } else {
    minimise<7>(graph, options, rules);
  }
  summary.iterations = rules.successful();
  summary.aborted = rules.aborted();
  summary.final_cost = summary.aborted ? summary.initial_cost : total_cost(graph);
  return summary;
}

}  // namespace orbslam
