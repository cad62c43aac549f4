// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "optimize/sim3_optimization.hpp"

namespace orbslam::sim3_residuals {

using Jacobian = Eigen::Matrix<double, 2, 7>;

/// A whitened residual, pixel minus projection, and its derivative in the left tangent of S_12. See
/// docs/method/adjustment.md#similarity-of-two-keyframes.
struct Residual {
  Eigen::Vector2d error;
  Jacobian jacobian;
  double depth = 0;  ///< of the projected point; its sign is the side of the camera's plane
};

/// In image 1, of S_12 point_2. Nothing for a point on the plane of the camera.
std::optional<Residual> forward(const Similarity& S_12, const Camera& camera_1,
                                const SimilarityMatch& match);
/// In image 2, of S_12^-1 point_1. Nothing for a point on the plane of the camera.
std::optional<Residual> inverse(const Similarity& S_12, const Camera& camera_2,
                                const SimilarityMatch& match);

}  // namespace orbslam::sim3_residuals
