// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <opencv2/core/mat.hpp>

#include "features/orb_extractor.hpp"
#include "frame/frame.hpp"
#include "frame/wide_pair.hpp"

namespace orbslam {

/// Camera, extractors and parameters that all frames of one system share.
struct FrameContext {
  std::shared_ptr<const Camera> camera;
  std::shared_ptr<const ScalePyramid> scales;
};

/// Frame of a single camera: undistorted keypoints, no depth. See
/// docs/method/frame.md#undistortion.
std::shared_ptr<Frame> build_monocular_frame(const FrameContext& context, FrameId id,
                                             double timestamp, Features features);

/// Frame of a rectified pair; depth by stereo matching (frame/stereo_matching.hpp). Throws
/// StateError for a camera without a baseline, ImageError as match_stereo() does. See
/// docs/method/frame.md#stereo-matching.
std::shared_ptr<Frame> build_stereo_frame(const FrameContext& context, FrameId id, double timestamp,
                                          Extraction left, const Extraction& right);

/// Frame of a fisheye pair, whose images are as the cameras take them; depth along the rays. The
/// camera of the context is the left one of the pair. Throws ImageError as WidePair::match() does.
/// See docs/method/frame.md#fisheye-pairs.
std::shared_ptr<Frame> build_wide_stereo_frame(const FrameContext& context, const WidePair& pair,
                                               FrameId id, double timestamp, Extraction left,
                                               const Extraction& right);

/// Frame of a colour image with registered depth (one channel; divided by `factor` as in
/// to_depth_metres() it is metres; <= 0, infinite or NaN: no depth), which is read at the pixel of
/// the distorted keypoint. Throws ImageError when the depth image has another size or several
/// channels, SettingsError for a bad factor, StateError for a camera without a (virtual) baseline.
/// See docs/method/frame.md#rgb-d-depth.
std::shared_ptr<Frame> build_rgbd_frame(const FrameContext& context, FrameId id, double timestamp,
                                        Features features, const cv::Mat& depth, double factor = 1);

}  // namespace orbslam
