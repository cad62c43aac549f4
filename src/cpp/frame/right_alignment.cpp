// SPDX-License-Identifier: BSD-3-Clause
#include "frame/right_alignment.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "alignment/align_patch.hpp"
#include "base/parallel.hpp"
#include "features/level_placement.hpp"

namespace orbslam {
namespace {

/// Keypoints that a thread takes at a time.
constexpr std::size_t kChunk = 128;
/// Most rows by which the right image may be off its rectification [pixels of the level].
constexpr double kMostRows = 1.5;

/// Most rows by which the two images of a pair may usually differ [pixels of the level]: with a
/// worse rectification an aligned column is no better than the parabola, and sightings that are
/// aligned between frames distort the map by the same errors.
constexpr float kMostRowError = 0.1F;
/// Least number of keypoints for the comparison of rows.
constexpr std::size_t kFewestRows = 30;

struct Aligned {
  float right_u = 0;
  float variance = 0;   ///< 0: not aligned
  float row_error = 0;  ///< right minus left row [pixels of the level]
};

/// Median of the distances between rows; 0 when there are too few.
float usual_row_error(const std::vector<Aligned>& aligned) {
  std::vector<float> distances;
  for (const Aligned& one : aligned) {
    if (one.variance > 0) distances.push_back(std::abs(one.row_error));
  }
  if (distances.size() < kFewestRows) return 0;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

Aligned align_one(const Keypoint& keypoint, float right_u, const cv::Mat& left,
                  const cv::Mat& right, const LevelPlacement& place) {
  Aligned result;
  const Eigen::Vector2d here(place.x.to_level(keypoint.x), place.y.to_level(keypoint.y));
  const Eigen::Vector2d start(place.x.to_level(right_u), here.y());
  ReferencePatch patch;
  if (!cut_patch(left, here, patch)) return result;
  const PatchAlignment aligned = align_patch(patch, Eigen::Matrix2d::Identity(), right, start);
  if (!aligned.ok() || std::abs(aligned.position.y() - start.y()) > kMostRows) return result;
  const double scale = place.x.to_image(1) - place.x.to_image(0);
  const double variance = aligned.information.inverse()(0, 0) + kLeastAlignedVariance;
  result.right_u = place.x.to_image(static_cast<float>(aligned.position.x()));
  result.variance = static_cast<float>(variance * scale * scale);
  result.row_error = static_cast<float>(aligned.position.y() - start.y());
  return result;
}

}  // namespace

int align_right_columns(Frame& frame, double bf, double max_disparity) {
  const auto images = frame.images ? frame.images->get() : nullptr;
  if (!images || images->right.levels.empty() || frame.camera->distorts()) return 0;
  std::vector<LevelPlacement> places;
  for (int level = 0; level < frame.scales->levels(); ++level) {
    places.emplace_back(*frame.scales, level, frame.camera->image_size());
  }
  std::vector<Aligned> aligned(frame.size());
  const std::size_t n_chunks = (frame.size() + kChunk - 1) / kChunk;
  for_each_in_parallel(n_chunks, threads_for(2), [&](std::size_t chunk) {
    const std::size_t end = std::min(frame.size(), (chunk + 1) * kChunk);
    for (std::size_t i = chunk * kChunk; i < end; ++i) {
      if (!frame.has_depth(i)) continue;
      const auto level = static_cast<std::size_t>(frame.keypoints[i].level);
      aligned[i] = align_one(frame.keypoints[i], frame.right_u[i], images->left.levels[level],
                             images->right.levels[level], places[level]);
    }
  });
  if (usual_row_error(aligned) > kMostRowError) {
    frame.images->release();
    return 0;
  }
  frame.right_variance.assign(frame.size(), 0);
  int n_aligned = 0;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    const float disparity = frame.keypoints[i].x - aligned[i].right_u;
    const bool usable =
        aligned[i].variance > 0 && disparity > 0 && disparity < static_cast<float>(max_disparity);
    if (!usable) continue;
    frame.right_u[i] = aligned[i].right_u;
    frame.depth[i] = static_cast<float>(bf) / disparity;
    frame.right_variance[i] = aligned[i].variance;
    ++n_aligned;
  }
  return n_aligned;
}

}  // namespace orbslam
