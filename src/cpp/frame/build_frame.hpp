// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>

#include "features/orb_extractor.hpp"
#include "frame/frame.hpp"

namespace orbslam {

/// What all frames of one system share.
struct FrameContext {
  std::shared_ptr<const Camera> camera;
  std::shared_ptr<const ScalePyramid> scales;
};

/// Frame of a single camera: undistorted keypoints, no depth.
std::shared_ptr<Frame> build_monocular_frame(const FrameContext& context, FrameId id,
                                             double timestamp, Features features);

/// Frame of a rectified pair; depth by stereo matching (frame/stereo_matching.hpp).
std::shared_ptr<Frame> build_stereo_frame(const FrameContext& context, FrameId id, double timestamp,
                                          Extraction left, const Extraction& right);

/// Frame of a colour image with registered depth (CV_32FC1, metres; <= 0 or NaN: no depth).
/// Throws ImageError when the depth image has another size or type.
std::shared_ptr<Frame> build_rgbd_frame(const FrameContext& context, FrameId id, double timestamp,
                                        Features features, const cv::Mat& depth);

}  // namespace orbslam
