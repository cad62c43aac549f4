// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <atomic>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "alignment/align_patch.hpp"
#include "alignment/patch_warp.hpp"
#include "features/image_pyramid.hpp"
#include "frame/frame.hpp"
#include "optimize/full_bundle_adjustment.hpp"
#include "optimize/patch_search.hpp"

namespace orbslam {

/// How many sightings were tried, by result: entry 0 is the number of aligned ones.
using AlignmentCounts = std::array<std::size_t, kAlignmentFailures>;

/// Noise of aligned sightings: their residuals over the covariances that the patches give.
struct AlignmentNoise {
  double factor = 1;     ///< of the standard deviations; 1 when nothing was aligned
  double deviation = 0;  ///< median standard deviation, so scaled [pixels of the level]
};

/// Full bundle adjustment with sightings that are aligned to each other. In every image, the pixel
/// of a point is moved until the image agrees with the point's reference sighting. Images are
/// passed one after the other and are not kept. See docs/method/alignment.md.
///
/// Order: take_references() for all images; then rounds of begin_round(), align() for all images,
/// weigh() and solve(); at last commit(). The map must not change meanwhile.
class SightingAlignment {
 public:
  /// Takes the read lock. `which`: as for gather_full_bundle().
  explicit SightingAlignment(const Map& map, MapIndex which = kNoMap,
                             AlignmentOptions options = {});

  /// Keyframes of the bundle, whose images must be passed.
  const std::vector<KeyFrameId>& keyframes() const { return bundle_.keyframes; }
  const GatheredBundle& bundle() const { return bundle_; }

  /// Keeps the patches of the reference sightings in this keyframe. Throws StateError for a
  /// keyframe that is not in the bundle, and ImageError for an image that is not one of 8 bits of
  /// the size of its camera.
  void take_references(KeyFrameId keyframe, const cv::Mat& grey);
  /// Predicts the pixels of the patches from the present poses and points; forgets the last round.
  void begin_round();
  /// Aligns the sightings in a keyframe. `right`: of a rectified pair, for the columns of stereo
  /// observations; empty if there is none: these columns then keep their disparity. Throws as
  /// take_references().
  void align(KeyFrameId keyframe, const cv::Mat& grey, const cv::Mat& right);
  /// Puts positions and weights of aligned sightings into the bundle.
  void weigh();
  /// Adjusts. If no step lowers the cost, the result of the round before stays.
  BundleSummary solve(const FullBundleOptions& options, const std::atomic<bool>* abort,
                      int n_threads);
  FullBundleCommit commit(Map& map) { return commit_full_bundle(map, bundle_); }

  AlignmentCounts counts() const { return count(&Sighting::left); }         ///< of this round
  AlignmentCounts right_counts() const { return count(&Sighting::right); }  ///< right columns
  const AlignmentNoise& noise() const { return noise_; }
  const AlignmentNoise& right_noise() const { return right_noise_; }
  /// Median distance between sightings and points [pixels], as they are in the bundle.
  double median_error() const;

 private:
  /// Result of a patch in an image.
  struct Match : FoundPatch {  // in the right image u alone is used
    bool tried = false;
    bool ok() const { return tried && FoundPatch::ok(); }
  };
  struct Sighting {
    float u = 0, v = 0, right_u = 0, inverse_sigma2 = 0;  ///< as they are in the map
    Match left, right;
  };
  struct Point {
    std::uint32_t reference = 0;  ///< observation
    bool has_patch = false;
    ReferencePatch patch;
    std::optional<SurfacePatch> surface;
  };
  struct Pyramids {
    ImagePyramid left, right;
  };

  std::uint32_t camera_of(KeyFrameId keyframe) const;
  const Frame& frame_of(const BundleProblem::Observation& o) const { return *frames_[o.camera]; }
  Eigen::Vector2f raw_of(std::size_t observation) const;
  void align_one(std::size_t observation, const Pyramids& images);
  Match match(const Point& point, const Frame& frame, const Pose& T_cw, const ImagePyramid& images,
              const Eigen::Vector2f& start) const;
  AlignmentCounts count(Match Sighting::*which) const;
  AlignmentNoise measure_noise(Match Sighting::*which) const;

  GatheredBundle bundle_;
  AlignmentOptions options_;
  std::vector<std::shared_ptr<const Frame>> frames_;  ///< per camera of the bundle
  std::vector<std::vector<std::uint32_t>> seen_by_;   ///< observations per camera
  std::vector<Point> points_;
  std::vector<Sighting> sightings_;  ///< per observation
  AlignmentNoise noise_, right_noise_;
};

}  // namespace orbslam
