// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "geometry/point_pairs.hpp"

namespace orbslam {

/// H_21 (x_2 ~ H_21 x_1, pixels) with the least algebraic error over the eight pairs, by the
/// normalised direct linear transform.
Eigen::Matrix3d fit_homography(const PointPairs& pairs, const EightPairs& sample,
                               const Normalization& normalization_1,
                               const Normalization& normalization_2);

/// The homography of the sample with the strictly highest score: the sum over pairs and both
/// directions of what is left of 5.991 after subtracting the squared transfer error over sigma^2
/// [pixels]. An inlier stays within the limit in both directions. See
/// docs/method/start.md#homography-or-fundamental-matrix.
ScoredModel best_homography(const PointPairs& pairs, const std::vector<EightPairs>& samples,
                            const Normalization& normalization_1,
                            const Normalization& normalization_2, double sigma);

}  // namespace orbslam
