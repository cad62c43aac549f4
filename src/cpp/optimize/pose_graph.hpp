// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "base/similarity.hpp"

namespace orbslam {

/// Relative poses measured between keyframes, as flat arrays: no map, no locks.
struct PoseGraph {
  struct Edge {
    std::uint32_t i = 0, j = 0;  ///< vertices
    Similarity S_ji;             ///< measured: camera i to camera j
  };
  std::vector<Similarity> S_iw;     ///< vertices: world to camera
  std::vector<std::uint8_t> fixed;  ///< per vertex; at least one must be
  std::vector<Edge> edges;
};

struct PoseGraphOptions {
  bool fix_scale = false;  ///< six degrees of freedom per vertex instead of seven
  /// Four degrees of freedom: with the scale, the direction of the world's third axis is kept in
  /// every camera.
  bool upright = false;
  int iterations = 20;  ///< accepted steps at most
  int n_threads = 1;    ///< 1 gives the same bytes in every run
  /// Solve by Eigen's sparse Cholesky, as always where Ceres comes without SuiteSparse: as fast for
  /// one loop and truly one thread, but slower by a multiple for thousands of vertices with many.
  bool eigen_cholesky = false;
};

struct PoseGraphSummary {
  double initial_cost = 0, final_cost = 0;  ///< sums of squared residuals
  int iterations = 0;                       ///< accepted steps
  bool aborted = false;                     ///< the vertices are as they were
};

/// Minimises the sum of |log(S_ji S_iw S_jw^-1)|^2 over the free vertices (Strasdat et al. 2010;
/// Mur-Artal et al. 2015, section VII-D), in place, practically by Gauss-Newton: damping starts
/// when a step fails. Ends after `iterations` accepted steps, three in a row that lower the cost by
/// less than a thousandth or one by less than 1e-9 of it, ten rejected ones in a row, or when
/// nothing is left to gain.
///
/// In a part of the graph that no edges join to a fixed vertex, its first vertex is held: the part
/// agrees with its measurements then and stays where that vertex is. Vertices without edges keep
/// their values. `abort` is polled once per iteration; nullptr: never.
///
/// Throws StateError, with the graph as it was: no vertex is fixed, the two vectors over vertices
/// differ in size, an edge names a vertex that does not exist or joins one to itself, a vertex or
/// an edge has a number that is not finite or a scale beyond exp(+-100). See
/// docs/method/adjustment.md#pose-graph.
PoseGraphSummary optimize_pose_graph(PoseGraph& graph, const PoseGraphOptions& options,
                                     const std::atomic<bool>* abort);

}  // namespace orbslam
