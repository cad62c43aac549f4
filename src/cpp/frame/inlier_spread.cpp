// SPDX-License-Identifier: BSD-3-Clause
#include "frame/inlier_spread.hpp"

#include <Eigen/Cholesky>
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
/// 95 % of chi-square, three degrees of freedom: aligned sightings beyond it did not influence the
/// pose.
constexpr double kAlignedGate = 7.815;

/// Measured pixel of a keypoint's point, and its weight.
AlignedPixel sighting_of(const TrackedFrame& tracked, std::size_t i) {
  if (const AlignedPixel* aligned = tracked.aligned_at(i)) return *aligned;
  const Frame& frame = *tracked.frame;
  const Keypoint& k = frame.keypoints[i];
  return {{}, k.x, k.y, frame.right_u[i], frame.scales->inverse_sigma2(k.level), 1};
}

/// Derivative of a raw pixel (u, v, right u) by the pose's tangent: rotation, then translation.
Eigen::Matrix<double, 3, kPoseParameters> by_pose(const Eigen::Matrix3d& by_point,
                                                  const Eigen::Vector3d& p) {
  Eigen::Matrix<double, 3, kPoseParameters> J;
  J.rightCols<3>() = by_point;
  for (int row = 0; row < 3; ++row) {
    J.row(row).head<3>() = p.cross(by_point.row(row).transpose()).transpose();
  }
  return J;
}

/// Sums over the inliers' whitened residuals, by cells.
struct Residuals {
  Matrix6d H = Matrix6d::Zero();
  std::array<Vector6d, kSpreadCells> gradients;
  double squares = 0;
  int n = 0;

  Residuals() { gradients.fill(Vector6d::Zero()); }

  void add(const TrackedFrame& tracked, std::size_t i, std::size_t cell, const Eigen::Vector3d& p,
           const AlignedPixel& seen, const Sight& sight) {
    const Frame& frame = *tracked.frame;
    const Eigen::Vector3d q = apply(sight, p);
    const Eigen::Vector2d error = q.head<2>() / q.z();
    Eigen::Matrix3d by_point = Eigen::Matrix3d::Zero();
    const Eigen::Matrix3d B = sight.leftCols<3>();
    by_point.topRows<2>() = (B.topRows<2>() - error * B.row(2)) / q.z();
    Eigen::Vector3d r(-error.x(), -error.y(), 0);
    const bool has_depth = frame.has_depth(i);
    if (has_depth) {
      const double bf = frame.camera->bf();
      by_point.row(2) = by_point.row(0) + bf / (q.z() * q.z()) * B.row(2);
      r.z() = -(error.x() + (seen.u - seen.right_u) - bf / q.z());
    }
    if (!r.allFinite()) return;
    const double weight = seen.inverse_sigma2;
    const Eigen::Vector3d weights(weight, weight, weight * static_cast<double>(seen.right_factor));
    const double square = r.dot(weights.cwiseProduct(r));
    if (seen.point.valid() && square > kAlignedGate) return;
    const auto J = by_pose(by_point, p);
    H.noalias() += J.transpose() * weights.asDiagonal() * J;
    gradients[cell].noalias() += J.transpose() * weights.cwiseProduct(r);
    squares += square;
    n += has_depth ? 3 : 2;
  }

  Matrix6d covariance(int n_cells) const {
    if (n <= kPoseParameters) return Matrix6d::Zero();
    const Eigen::LLT<Matrix6d> factor(H);
    if (factor.info() != Eigen::Success) return Matrix6d::Zero();
    Matrix6d scatter = Matrix6d::Zero();
    for (const Vector6d& g : gradients) scatter.noalias() += g * g.transpose();
    const Matrix6d unit = factor.solve(Matrix6d::Identity());
    const Matrix6d robust = unit * scatter * unit;
    const Matrix6d classical = squares / (n - kPoseParameters) * unit;
    const Matrix6d sum = n_cells * robust + kPriorCells * classical;
    const Matrix6d mean = sum / (n_cells + kPriorCells - kPoseParameters);
    return mean.allFinite() ? Matrix6d(0.5 * (mean + mean.transpose())) : Matrix6d::Zero();
  }
};

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
  Residuals residuals;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    if (!tracked.map_points[i].valid() || tracked.outlier[i]) continue;
    const Keypoint& keypoint = frame.keypoints[i];
    const int column = static_cast<int>((keypoint.x - bounds.min_x) * across);
    const int row = static_cast<int>((keypoint.y - bounds.min_y) * down);
    const auto cell =
        static_cast<std::size_t>(std::clamp(row, 0, kSpreadRows - 1) * kSpreadColumns +
                                 std::clamp(column, 0, kSpreadColumns - 1));
    cells.set(cell);
    const Eigen::Vector3d p = R * tracked.positions[i] + tracked.T_cw->translation();
    const AlignedPixel seen = sighting_of(tracked, i);
    const Sight sight = camera.sight(seen.u, seen.v);
    const double depth = apply(sight, p).z();
    if (!(depth > 0)) continue;
    octaves.set(
        static_cast<std::size_t>(std::clamp(std::ilogb(depth) + kOctaves / 2, 0, kOctaves - 1)));
    residuals.add(tracked, i, cell, p, seen, sight);
  }
  const int n_cells = static_cast<int>(cells.count());
  return {n_cells, static_cast<int>(octaves.count()), residuals.covariance(n_cells)};
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
