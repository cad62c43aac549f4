// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "geometry/point_pairs.hpp"

namespace orbslam {

/// F_21 of rank 2 (x_2^T F_21 x_1 = 0, pixels) of eight pairs, by the normalised eight-point
/// algorithm.
Eigen::Matrix3d fit_fundamental(const PointPairs& pairs, const EightPairs& sample,
                                const Normalization& normalization_1,
                                const Normalization& normalization_2);

/// The fundamental matrix of the sample with the strictly highest score. A direction (point to
/// epipolar line) counts with 5.991 minus the squared distance over sigma^2 [pixels] while the
/// latter is at most 3.841; 5.991 makes the scores comparable with those of homographies. An
/// inlier stays within 3.841 in both directions. See
/// docs/method/start.md#homography-or-fundamental-matrix.
ScoredModel best_fundamental(const PointPairs& pairs, const std::vector<EightPairs>& samples,
                             const Normalization& normalization_1,
                             const Normalization& normalization_2, double sigma);

}  // namespace orbslam
