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
  int iterations = 20;     ///< accepted steps at most
  int n_threads = 1;       ///< 1 gives the same bytes in every run
};

struct PoseGraphSummary {
  double initial_cost = 0, final_cost = 0;  ///< sums of squared residuals
  int iterations = 0;                       ///< accepted steps
  bool aborted = false;                     ///< the vertices are as they were
};

/// Minimises the sum of |log(S_ji S_iw S_jw^-1)|^2 over the free vertices (Strasdat et al. 2010;
/// Mur-Artal et al. 2015, section VII-D; spec 16, section 6), in place, practically by
/// Gauss-Newton. `abort` is polled once per iteration; nullptr: never. Throws StateError for an
/// edge that names a vertex that does not exist, and when no vertex is fixed.
PoseGraphSummary optimize_pose_graph(PoseGraph& graph, const PoseGraphOptions& options,
                                     const std::atomic<bool>* abort);

}  // namespace orbslam
