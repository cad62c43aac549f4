// SPDX-License-Identifier: BSD-3-Clause
#include "frame/rig_frame.hpp"

#include <algorithm>
#include <iterator>

#include "base/errors.hpp"
#include "base/parallel.hpp"

namespace orbslam {
namespace {

template <class Item>
void append(const std::vector<Item>& from, std::vector<Item>& to) {
  to.insert(to.end(), from.begin(), from.end());
}

void append_shifted(std::vector<Keypoint> keypoints, float column, std::vector<Keypoint>& to) {
  for (Keypoint& keypoint : keypoints) keypoint.x += column;
  append(keypoints, to);
}

/// The keypoints of one camera, with the data of each.
void append_features(const Frame& from, float column, bool distorts, Frame& to) {
  append_shifted(from.keypoints, column, to.keypoints);
  if (distorts) {
    append_shifted(from.raw_keypoints.empty() ? from.keypoints : from.raw_keypoints, column,
                   to.raw_keypoints);
  }
  append(from.descriptors, to.descriptors);
  append(from.depth, to.depth);
  for (std::size_t i = 0; i < from.size(); ++i) {
    to.right_u.push_back(from.has_depth(i) ? from.right_u[i] + column : from.right_u[i]);
  }
}

}  // namespace

RigExtractor::RigExtractor(const OrbOptions& options, std::size_t n_cameras) {
  for (std::size_t i = 0; i < n_cameras; ++i) {
    extractors_.push_back(std::make_unique<OrbExtractor>(options));
  }
}

std::vector<Extraction> RigExtractor::extract(const std::vector<cv::Mat>& images,
                                              const std::vector<cv::Mat>& masks) {
  const std::size_t n = extractors_.size();
  if (images.size() != n || masks.size() != n) {
    throw StateError("a rig of " + std::to_string(n) + " cameras needs as many images and masks");
  }
  std::vector<Extraction> extractions(n);
  for_each_in_parallel(n, threads_for(n), [&](std::size_t i) {
    if (!images[i].empty()) extractions[i] = extractors_[i]->extract(images[i], masks[i]);
  });
  return extractions;
}

std::shared_ptr<Frame> join_frames(const FrameContext& context, FrameId id, double timestamp,
                                   const std::vector<std::shared_ptr<const Frame>>& frames) {
  const Camera& rig = *context.camera;
  if (!rig.is_rig() || frames.size() != rig.n_cameras()) {
    throw StateError("join_frames: one frame, or none, for each camera of a rig");
  }
  auto joined = std::make_shared<Frame>();
  joined->id = id;
  joined->timestamp = timestamp;
  joined->camera = context.camera;
  joined->scales = context.scales;
  bool coloured = true;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (!frames[i]) continue;
    if (frames[i]->camera != rig.members()[i].camera) {
      throw StateError("join_frames: frame " + std::to_string(i) + " is of another camera");
    }
    append_features(*frames[i], static_cast<float>(rig.column_of(i)), rig.distorts(), *joined);
    coloured &= frames[i]->colours.size() == frames[i]->size();
    if (coloured) append(frames[i]->colours, joined->colours);
  }
  if (!coloured) joined->colours.clear();
  joined->grid = KeypointGrid(joined->keypoints, rig.bounds());
  return joined;
}

}  // namespace orbslam
