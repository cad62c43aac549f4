// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "features/orb_extractor.hpp"
#include "frame/build_frame.hpp"
#include "places/vocabulary.hpp"

namespace orbslam::driver {

/// A camera that turns round in a room, once per lap; rendered when made, played as often as
/// wanted.
class ImageRing {
 public:
  ImageRing(int frames_per_lap, std::uint64_t seed);

  /// The true pose of a view: turning steadily on the spot, the camera held at arm's length.
  static Pose T_wc(std::int64_t view, int frames_per_lap);

  int size() const { return static_cast<int>(views_.size()); }
  /// The frame of the view number `view` (any number), described. Depths are stretched by
  /// `depth_factor`: a drift that a loop can take out. One thread.
  std::shared_ptr<Frame> frame(std::int64_t view, FrameId id, double timestamp,
                               double depth_factor);
  /// Of what all views show, and of what was found in them: equal bytes have equal hashes.
  std::uint64_t grey_hash() const;
  std::uint64_t depth_hash() const;
  std::uint64_t feature_hash() const;
  /// A frame on which nothing is seen.
  std::shared_ptr<Frame> dark_frame(FrameId id, double timestamp);

 private:
  struct View {
    cv::Mat grey, depth;
    Features features;
  };
  std::shared_ptr<Frame> build(const Features& features, const cv::Mat& depth, FrameId id,
                               double timestamp) const;

  std::vector<View> views_;
  View dark_;
  OrbExtractor extractor_;
  FrameContext context_;
  std::shared_ptr<const Vocabulary> vocabulary_;
};

}  // namespace orbslam::driver
