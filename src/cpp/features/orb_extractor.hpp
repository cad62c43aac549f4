// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>

#include "base/scale_pyramid.hpp"
#include "features/image_pyramid.hpp"
#include "features/kernels.hpp"
#include "features/keypoint.hpp"

namespace orbslam {

struct OrbOptions {
  int n_features = 1000;      ///< keypoints wanted per image, all levels together
  float scale_factor = 1.2F;  ///< ratio between levels
  int n_levels = 8;
  int initial_threshold = 20;         ///< FAST threshold, grey levels
  int minimum_threshold = 7;          ///< used in cells where the first finds nothing
  bool original_coordinates = false;  ///< ScalePyramid::original_coordinates()

  /// Throws SettingsError naming the option that is out of range.
  void check() const;
};

struct Extraction {
  Features features;
  ImagePyramid pyramid;
};

/// Distributed FAST corners with orientation and rotated BRIEF descriptors
/// (ORB: Rublee et al. 2011; distribution by quadtree: Mur-Artal et al. 2015, section III).
///
/// An extractor owns its scratch buffers: one thread at a time per extractor. The result depends
/// on the image and the options only. See docs/method/features.md#pyramid and what follows it.
class OrbExtractor {
 public:
  /// `unit`: one of `vector_units`; all give the same bytes. Throws SettingsError for options out
  /// of range.
  explicit OrbExtractor(const OrbOptions& options, VectorUnit unit = best_vector_unit());
  ~OrbExtractor();
  OrbExtractor(OrbExtractor&&) noexcept;
  OrbExtractor& operator=(OrbExtractor&&) noexcept;

  /// `grey`: CV_8UC1, not empty. `mask`: empty, or CV_8UC1 of the same size with 0 where no
  /// keypoint may lie; applied before the distribution so that the feature budget is kept.
  /// Throws ImageError for anything else.
  Extraction extract(const cv::Mat& grey, const cv::Mat& mask = {});

  const OrbOptions& options() const;
  const ScalePyramid& scales() const;
  /// The unit whose kernels are in use.
  VectorUnit vector_unit() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace orbslam
