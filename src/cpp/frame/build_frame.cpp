// SPDX-License-Identifier: BSD-3-Clause
#include "frame/build_frame.hpp"

#include <cmath>
#include <cstring>
#include <string>
#include <utility>

#include "base/errors.hpp"
#include "frame/image_input.hpp"
#include "frame/stereo_matching.hpp"

namespace orbslam {
namespace {

constexpr float kUnknown = -1.0F;

std::vector<Keypoint> undistorted(const Camera& camera, const std::vector<Keypoint>& raw) {
  std::vector<Keypoint> keypoints = raw;
  for (Keypoint& keypoint : keypoints) {
    const Eigen::Vector2f uv = camera.from_image({keypoint.x, keypoint.y});
    keypoint.x = uv.x();
    keypoint.y = uv.y();
  }
  return keypoints;
}

// Fills everything but the depths. A frame may have no keypoints.
std::shared_ptr<Frame> frame_of(const FrameContext& context, FrameId id, double timestamp,
                                Features features) {
  auto frame = std::make_shared<Frame>();
  frame->id = id;
  frame->timestamp = timestamp;
  frame->camera = context.camera;
  frame->scales = context.scales;
  frame->descriptors = std::move(features.descriptors);
  if (!context.camera->distorts()) {
    frame->keypoints = std::move(features.keypoints);
  } else {
    frame->keypoints = undistorted(*context.camera, features.keypoints);
    frame->raw_keypoints = std::move(features.keypoints);
  }
  frame->grid = KeypointGrid(frame->keypoints, context.camera->bounds());
  return frame;
}

void clear_depth(Frame& frame) {
  frame.right_u.assign(frame.size(), kUnknown);
  frame.depth.assign(frame.size(), kUnknown);
}

void check_depth(const cv::Mat& depth, ImageSize size) {
  if (depth.channels() != 1) {
    throw ImageError("depth image must have one channel, got " + std::to_string(depth.channels()));
  }
  if (depth.cols != size.width || depth.rows != size.height) {
    throw ImageError("depth image is " + std::to_string(depth.cols) + "x" +
                     std::to_string(depth.rows) + ", expected " + std::to_string(size.width) + "x" +
                     std::to_string(size.height) + " like the colour image");
  }
}

/// The raw depth at each keypoint, one a row; 0 outside the image. Converting these alone is some
/// hundred times less work than converting the image.
cv::Mat depths_at(const cv::Mat& depth, const std::vector<Keypoint>& keypoints, float rounding) {
  cv::Mat found(static_cast<int>(keypoints.size()), 1, depth.type(), cv::Scalar(0));
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const int column = static_cast<int>(keypoints[i].x + rounding);
    const int row = static_cast<int>(keypoints[i].y + rounding);
    if (column < 0 || column >= depth.cols || row < 0 || row >= depth.rows) continue;
    std::memcpy(found.ptr(static_cast<int>(i)), depth.ptr(row, column), depth.elemSize());
  }
  return found;
}

}  // namespace

std::shared_ptr<Frame> build_monocular_frame(const FrameContext& context, FrameId id,
                                             double timestamp, Features features) {
  auto frame = frame_of(context, id, timestamp, std::move(features));
  clear_depth(*frame);
  return frame;
}

std::shared_ptr<Frame> build_stereo_frame(const FrameContext& context, FrameId id, double timestamp,
                                          Extraction left, const Extraction& right) {
  const Camera& camera = *context.camera;
  if (!camera.has_baseline()) {
    throw StateError("a stereo frame needs a camera with a baseline; set Camera.bf");
  }
  StereoMatches matches =
      match_stereo(left, right, *context.scales, camera.bf(), camera.pinhole().fx);
  auto frame = frame_of(context, id, timestamp, std::move(left.features));
  frame->right_u = std::move(matches.right_u);
  frame->depth = std::move(matches.depth);
  return frame;
}

std::shared_ptr<Frame> build_wide_stereo_frame(const FrameContext& context, const WidePair& pair,
                                               FrameId id, double timestamp, Extraction left,
                                               const Extraction& right) {
  StereoMatches matches = pair.match(left, right, *context.scales);
  auto frame = frame_of(context, id, timestamp, std::move(left.features));
  frame->right_u = std::move(matches.right_u);
  frame->depth = std::move(matches.depth);
  return frame;
}

std::shared_ptr<Frame> build_rgbd_frame(const FrameContext& context, FrameId id, double timestamp,
                                        Features features, const cv::Mat& depth, double factor) {
  const Camera& camera = *context.camera;
  if (!camera.has_baseline()) {
    throw StateError("an RGB-D frame needs a camera with a virtual baseline; set Camera.bf");
  }
  check_depth(depth, camera.image_size());
  auto frame = frame_of(context, id, timestamp, std::move(features));
  clear_depth(*frame);
  if (frame->size() == 0) return frame;

  const auto& raw = frame->raw_keypoints.empty() ? frame->keypoints : frame->raw_keypoints;
  const float bf = static_cast<float>(camera.bf());
  // The pixel in which the keypoint lies; the original truncates, which the multiples of its
  // coordinates make half a pixel too little.
  const float rounding = context.scales->original_coordinates() ? 0.0F : 0.5F;
  const cv::Mat metres = to_depth_metres(depths_at(depth, raw, rounding), factor);
  for (std::size_t i = 0; i < raw.size(); ++i) {
    const float z = metres.at<float>(static_cast<int>(i));
    // Some drivers write infinity for "too far"; it counts as no measurement.
    if (!(z > 0.0F) || !std::isfinite(z)) continue;
    const Keypoint& keypoint = frame->keypoints[i];
    const auto metric = static_cast<float>(camera.depth_of_axial(keypoint.x, keypoint.y, z));
    if (!(metric > 0.0F)) continue;
    frame->depth[i] = metric;
    frame->right_u[i] = keypoint.x - bf / metric;
  }
  return frame;
}

}  // namespace orbslam
