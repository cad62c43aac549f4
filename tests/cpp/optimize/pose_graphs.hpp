// SPDX-License-Identifier: BSD-3-Clause
// Pose graphs of the tests, and comparisons of their vertices.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <random>
#include <vector>

#include "optimize/pose_graph.hpp"
#include "support/random_numbers.hpp"

namespace orbslam::testing {

inline Vector7d random_tangent(std::mt19937_64& random, double rotation, double translation,
                               double log_scale) {
  Vector7d delta;
  for (int i = 0; i < 3; ++i) delta(i) = uniform(random, -rotation, rotation);
  for (int i = 3; i < 6; ++i) delta(i) = uniform(random, -translation, translation);
  delta(6) = uniform(random, -log_scale, log_scale);
  return delta;
}

inline double distance(const Similarity& a, const Similarity& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff();
}

inline double worst(const std::vector<Similarity>& a, const std::vector<Similarity>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, distance(a[i], b[i]));
  return largest;
}

/// Also of numbers that are not equal to themselves; between numbers there may be padding.
inline bool same_bytes(const std::vector<Similarity>& a, const std::vector<Similarity>& b) {
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

/// A walk of n vertices in the manner of keyframes: each tied to some of those before, the last to
/// the first ones. `noise` spoils the measurements.
inline PoseGraph walk(std::uint32_t n, std::uint64_t seed, double log_scale, double noise) {
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
inline void drift(PoseGraph& graph, std::uint64_t seed, double rotation, double translation,
                  double log_scale) {
  std::mt19937_64 random(seed);
  Similarity error;
  for (std::size_t i = 0; i < graph.S_iw.size(); ++i) {
    if (graph.fixed[i] != 0) continue;
    error = Similarity::exp(random_tangent(random, rotation, translation, log_scale)) * error;
    graph.S_iw[i] = graph.S_iw[i] * error;
  }
}

}  // namespace orbslam::testing
