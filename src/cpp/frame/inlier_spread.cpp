// SPDX-License-Identifier: BSD-3-Clause
#include "frame/inlier_spread.hpp"

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <vector>

#include "base/errors.hpp"

namespace orbslam {
namespace {

constexpr int kSpreadCells = kSpreadColumns * kSpreadRows;
constexpr int kPoseParameters = 6;

/// Whitened residuals of one cell.
struct CellResiduals {
  int n = 0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double squares = 0;

  void add(const Eigen::Vector2d& residual) {
    n += 1;
    sum += residual;
    squares += residual.squaredNorm();
  }
};

/// Analysis of variance: that between the cells that hold several residuals, by that of all.
double correlation(const std::array<CellResiduals, kSpreadCells>& cells) {
  double between = 0, within = 0;
  int n_between = -kPoseParameters, n_within = 0;
  for (const CellResiduals& cell : cells) {
    if (cell.n < 2) continue;
    const double common = cell.sum.squaredNorm() / cell.n;
    between += common;
    within += cell.squares - common;
    n_between += 2;
    n_within += 2 * (cell.n - 1);
  }
  const double all = between + within;
  if (n_between <= 0 || !(all > 0) || !std::isfinite(all)) return 1;
  return (between / n_between) / (all / (n_between + n_within));
}

}  // namespace

InlierSpread spread_of_inliers(const TrackedFrame& tracked) {
  if (!tracked.T_cw) {
    throw StateError("spread_of_inliers: the frame has no pose; inliers belong to one");
  }
  const Frame& frame = *tracked.frame;
  const ImageBounds& bounds = frame.camera->bounds();
  const float across = kSpreadColumns / (bounds.max_x - bounds.min_x);
  const float down = kSpreadRows / (bounds.max_y - bounds.min_y);
  const Camera& camera = *frame.camera;
  const Eigen::Matrix3d R = tracked.T_cw->rotation_matrix();

  constexpr int kOctaves = 64;
  std::bitset<kSpreadCells> cells;
  std::bitset<kOctaves> octaves;
  std::array<CellResiduals, kSpreadCells> residuals;
  int n = 0;
  double variances = 0;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    if (!tracked.map_points[i].valid() || tracked.outlier[i]) continue;
    const Keypoint& keypoint = frame.keypoints[i];
    n += 1;
    variances += frame.scales->sigma2(keypoint.level);
    const int column = static_cast<int>((keypoint.x - bounds.min_x) * across);
    const int row = static_cast<int>((keypoint.y - bounds.min_y) * down);
    const auto cell =
        static_cast<std::size_t>(std::clamp(row, 0, kSpreadRows - 1) * kSpreadColumns +
                                 std::clamp(column, 0, kSpreadColumns - 1));
    cells.set(cell);
    const Eigen::Vector3d p = R * tracked.positions[i] + tracked.T_cw->translation();
    Eigen::Vector2d pixel;
    if (!camera.project(p, pixel)) continue;
    octaves.set(
        static_cast<std::size_t>(std::clamp(std::ilogb(p.z()) + kOctaves / 2, 0, kOctaves - 1)));
    const double weight = std::sqrt(frame.scales->inverse_sigma2(keypoint.level));
    residuals[cell].add(weight * (pixel - Eigen::Vector2d(keypoint.x, keypoint.y)));
  }
  return {static_cast<int>(cells.count()), static_cast<int>(octaves.count()),
          correlation(residuals), n > 0 ? variances / n : 0};
}

int count_staying(const TrackedFrame& tracked, const Pose& T_nw) {
  const Frame& frame = *tracked.frame;
  const Camera& camera = *frame.camera;
  const ImageBounds& bounds = camera.bounds();
  const Eigen::Matrix3d R = T_nw.rotation_matrix();
  int n = 0;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    if (!tracked.map_points[i].valid() || tracked.outlier[i]) continue;
    const Eigen::Vector3d p = R * tracked.positions[i] + T_nw.translation();
    Eigen::Vector2d pixel;
    if (!camera.project(p, pixel)) continue;
    n += bounds.contains(pixel.x(), pixel.y()) ? 1 : 0;
  }
  return n;
}

double median_displacement(const TrackedFrame& tracked, const Pose& T_nw) {
  if (!tracked.T_cw) {
    throw StateError("median_displacement: the frame has no pose; set T_cw first");
  }
  const Frame& frame = *tracked.frame;
  const Camera& camera = *frame.camera;
  const Eigen::Matrix3d R_cw = tracked.T_cw->rotation_matrix(), R_nw = T_nw.rotation_matrix();
  static thread_local std::vector<double> distances;  // calls after the first allocate nothing
  distances.clear();
  for (std::size_t i = 0; i < frame.size(); ++i) {
    if (!tracked.map_points[i].valid() || tracked.outlier[i]) continue;
    const Eigen::Vector3d here = R_cw * tracked.positions[i] + tracked.T_cw->translation();
    const Eigen::Vector3d there = R_nw * tracked.positions[i] + T_nw.translation();
    Eigen::Vector2d from, to;
    if (!camera.project(here, from) || !camera.project(there, to)) continue;
    const double distance = (to - from).norm();
    if (std::isfinite(distance)) distances.push_back(distance);
  }
  if (distances.empty()) return 0;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

}  // namespace orbslam
