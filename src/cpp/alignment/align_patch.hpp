// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>

#include "alignment/reference_patch.hpp"

namespace orbslam {

/// Why a patch was not aligned.
enum class AlignmentFailure : std::uint8_t {
  kNone,            ///< it was
  kOutside,         ///< patch or image do not reach that far, or a number is not finite
  kFlat,            ///< no texture, or texture in one direction only (an edge)
  kNotConverged,    ///< it moved too far, or did not converge
  kLowCorrelation,  ///< it converged where the grey values do not agree
};
constexpr int kAlignmentFailures = 5;  ///< values of the enum

struct AlignmentOptions {
  static constexpr double kMostShift = 4;

  int iterations = 15;           ///< steps at most
  double max_shift = 3;          ///< from the start [pixels of the level], at most kMostShift
  double min_correlation = 0.8;  ///< of the grey values, 0 to 1
  double converged = 0.01;       ///< a step shorter than that is the last one [pixels]
};

/// Least variance of an aligned position [pixels of the level, squared]. Interpolation and the
/// assumed shape of the patch cause errors of this size.
inline constexpr double kLeastAlignedVariance = 0.05 * 0.05;

struct PatchAlignment {
  AlignmentFailure failure = AlignmentFailure::kOutside;
  int iterations = 0;
  Eigen::Vector2d position = Eigen::Vector2d::Zero();  ///< pixels of the level
  /// Inverse covariance of the position [pixels^-2]: by the gradients and by the squared
  /// differences of the grey values after gain and offset. The noise of the image counts as white,
  /// before the smoothing.
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  double correlation = 0;  ///< of the grey values, -1 to 1
  double gain = 0;         ///< contrast of the image over that of the reference

  bool ok() const { return failure == AlignmentFailure::kNone; }
};

/// Moves a 9 x 9 patch over an image until the grey values agree, but for gain and offset: inverse
/// compositional Gauss-Newton of the translation. `A` maps pixels around the reference's keypoint
/// to pixels around `start`, each of its own level. See docs/method/alignment.md.
///
/// The same input gives the same bytes with every vector unit. Nothing is allocated.
PatchAlignment align_patch(const ReferencePatch& reference, const Eigen::Matrix2d& A,
                           const cv::Mat& level, const Eigen::Vector2d& start,
                           const AlignmentOptions& options = {});

}  // namespace orbslam
