// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "camera/camera.hpp"

namespace orbslam {

/// A keypoint as homogeneous coordinates h of its image, and the matrix B that compares others with
/// it: the error of h' is ((B h')_0, (B h')_1) / (B h')_2 in raw pixels. Of a flat plane h is (u,
/// v, 1), of a fisheye lens the unit ray.
struct HomogeneousPoint {
  Eigen::Vector3d h;
  Eigen::Matrix3d B;
  Eigen::Matrix<double, 3, 2> by_pixel;  ///< how h moves with the raw pixel
};

/// Matched pixels of two views, one pair per index.
struct PointPairs {
  Eigen::ArrayXd u_1, v_1, u_2, v_2;
  /// Of a camera that is no pinhole: the same points.
  std::vector<HomogeneousPoint> points_1, points_2;
  bool flat = true;  ///< h is (u, v, 1)

  std::size_t size() const { return static_cast<std::size_t>(u_1.size()); }
  void resize(std::size_t count);
};

/// The matrix that relates h to directions: the calibration matrix of a flat plane, or the
/// identity.
Eigen::Matrix3d calibration_of(const Camera& camera);

/// Adds the homogeneous points of a camera that is no pinhole.
void add_homogeneous_points(const Camera& camera, PointPairs& pairs);

/// The pairs of all initial points i with matches[i] >= 0, ascending by i.
/// Throws std::invalid_argument when a match is out of range or the lengths differ. See
/// docs/method/start.md#two-views.
PointPairs gather_pairs(const std::vector<Eigen::Vector2f>& initial,
                        const std::vector<Eigen::Vector2f>& current,
                        const std::vector<int>& matches);

/// Indices of the pairs from which one model is estimated.
using EightPairs = std::array<int, 8>;

/// Scaling and shift of pixels to mean 0 and mean absolute deviation 1 in each direction.
struct Normalization {
  double scale_u = 1, scale_v = 1, shift_u = 0, shift_v = 0;

  double u(double pixel) const { return scale_u * pixel + shift_u; }
  double v(double pixel) const { return scale_v * pixel + shift_v; }
  /// Maps homogeneous pixels to normalised ones.
  Eigen::Matrix3d matrix() const;
  Eigen::Matrix3d inverse() const;
};

/// False when there are no points or all lie on one row or column, so that no scale is defined.
bool normalize(const std::vector<Eigen::Vector2f>& points, Normalization& normalization);

/// A model and its inliers.
struct ScoredModel {
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
  double score = 0;                   ///< 0: no model explains anything
  std::vector<std::uint8_t> inliers;  ///< per pair
  std::size_t n_inliers = 0;
};

}  // namespace orbslam
