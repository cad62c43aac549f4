// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "features/orb_extractor.hpp"
#include "frame/build_frame.hpp"

namespace orbslam {

/// One extractor for each camera of a rig, which work at the same time. One thread at a time.
class RigExtractor {
 public:
  RigExtractor(const OrbOptions& options, std::size_t n_cameras);

  /// Extractions of the images, in their order; an empty image gives an empty extraction. Images
  /// and masks as for OrbExtractor::extract; an empty mask: none. The result does not depend on the
  /// number of threads. Throws StateError for another number of images or masks.
  std::vector<Extraction> extract(const std::vector<cv::Mat>& images,
                                  const std::vector<cv::Mat>& masks);

 private:
  std::vector<std::unique_ptr<OrbExtractor>> extractors_;
};

/// Frame of a rig from the frames of its cameras, in their order; null: that camera has none. The
/// camera of the context is the rig. Pixels become those of the rig's plane. Throws StateError when
/// their number is another or a frame is not of its camera. See docs/method/frame.md#rigs.
std::shared_ptr<Frame> join_frames(const FrameContext& context, FrameId id, double timestamp,
                                   const std::vector<std::shared_ptr<const Frame>>& frames);

}  // namespace orbslam
