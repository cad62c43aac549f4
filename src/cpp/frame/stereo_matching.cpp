// SPDX-License-Identifier: BSD-3-Clause
#include "frame/stereo_matching.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "base/errors.hpp"
#include "features/level_placement.hpp"
#include "frame/stereo_kernels.hpp"

namespace orbslam {
namespace {

using stereo::kHalfSearch;
using stereo::kHalfWindow;
using stereo::kShifts;
using stereo::kStripWidth;
using stereo::kWindow;

constexpr float kUnmatched = -1.0F;
constexpr int kDescriptorLimit = 75;
constexpr int kLevelTolerance = 1;
constexpr float kRowBand = 2.0F;  // pixels of a keypoint's level by which its row may be off
constexpr float kSmallestDisparity = 0.01F;
// 1.5 * 1.4, after the usual robust estimate of a standard deviation from a median.
constexpr float kOutlierFactor = 2.1F;

// The fields of a right keypoint that the coarse search reads, in one array for speed.
struct Candidate {
  float u;
  std::int32_t level;
  std::uint32_t index;
};

// For every image row the right keypoints that may lie on it, in ascending index.
class RowTable {
 public:
  RowTable(const std::vector<Keypoint>& keypoints, const ScalePyramid& scales, int rows)
      : offsets_(static_cast<std::size_t>(rows) + 1, 0) {
    std::vector<std::pair<int, int>> spans(keypoints.size());
    for (std::size_t i = 0; i < keypoints.size(); ++i) {
      const float r = kRowBand * scales.scale(keypoints[i].level);
      const int first = std::max(0, static_cast<int>(std::floor(keypoints[i].y - r)));
      const int last = std::min(rows - 1, static_cast<int>(std::ceil(keypoints[i].y + r)));
      spans[i] = {first, last};
      for (int row = first; row <= last; ++row) ++offsets_[static_cast<std::size_t>(row) + 1];
    }
    for (std::size_t row = 0; row + 1 < offsets_.size(); ++row) offsets_[row + 1] += offsets_[row];
    candidates_.resize(offsets_.back());
    std::vector<std::size_t> next(offsets_.begin(), offsets_.end() - 1);
    for (std::size_t i = 0; i < keypoints.size(); ++i) {
      const Candidate candidate{keypoints[i].x, keypoints[i].level, static_cast<std::uint32_t>(i)};
      for (int row = spans[i].first; row <= spans[i].second; ++row) {
        candidates_[next[static_cast<std::size_t>(row)]++] = candidate;
      }
    }
  }

  const Candidate* begin(int row) const {
    return candidates_.data() + offsets_[static_cast<std::size_t>(row)];
  }
  const Candidate* end(int row) const { return begin(row + 1); }

 private:
  std::vector<std::size_t> offsets_;
  std::vector<Candidate> candidates_;
};

constexpr std::uint32_t kNoMatch = 0xFFFFFFFFU;

// The right keypoint with the most similar descriptor; the lowest index among equals.
std::uint32_t most_similar(const Keypoint& keypoint, const Descriptor& descriptor,
                           const RowTable& table, const std::vector<Descriptor>& right,
                           float max_disparity) {
  const int row = static_cast<int>(keypoint.y);
  const float min_u = keypoint.x - max_disparity;
  int best_distance = kDescriptorLimit;
  std::uint32_t best = kNoMatch;
  for (const Candidate* c = table.begin(row); c != table.end(row); ++c) {
    if (std::abs(c->level - keypoint.level) > kLevelTolerance) continue;
    if (c->u < min_u || c->u > keypoint.x) continue;
    const int distance = hamming_distance(descriptor, right[c->index]);
    if (distance < best_distance) {
      best_distance = distance;
      best = c->index;
    }
  }
  return best;
}

struct Refined {
  float right_u;
  int sad;
};

// The windows around (x_left, y) and (x_right, y); false when one leaves its image.
bool cut_windows(const cv::Mat& left, const cv::Mat& right, int x_left, int x_right, int y,
                 stereo::WindowPair& windows) {
  constexpr int kReach = kHalfWindow + kHalfSearch;
  if (y - kHalfWindow < 0 || y + kHalfWindow >= std::min(left.rows, right.rows)) return false;
  if (x_left - kHalfWindow < 0 || x_left + kHalfWindow >= left.cols) return false;
  // One more column on the right than the windows cover, as the reference has it.
  if (x_right - kReach < 0 || x_right + kReach + 1 >= right.cols) return false;
  for (int row = 0; row < kWindow; ++row) {
    std::memcpy(windows.left[row], left.ptr(y - kHalfWindow + row) + x_left - kHalfWindow, kWindow);
    std::memcpy(windows.right[row], right.ptr(y - kHalfWindow + row) + x_right - kReach,
                kStripWidth);
  }
  return true;
}

// Slides the left window along the right image and fits a parabola through the best three sums.
bool refine(const Keypoint& keypoint, float coarse_u, const ImagePyramid& left,
            const ImagePyramid& right, const std::vector<LevelPlacement>& placements,
            stereo::ShiftedSad shifted_sad, stereo::WindowPair& windows, Refined& refined) {
  const auto level = static_cast<std::size_t>(keypoint.level);
  const LevelPlacement& placement = placements[level];
  const int x_left = static_cast<int>(std::round(placement.x.to_level(keypoint.x)));
  const int y = static_cast<int>(std::round(placement.y.to_level(keypoint.y)));
  const int x_right = static_cast<int>(std::round(placement.x.to_level(coarse_u)));
  if (!cut_windows(left.levels[level], right.levels[level], x_left, x_right, y, windows)) {
    return false;
  }

  int sums[kShifts];
  shifted_sad(windows, sums);
  const int best = static_cast<int>(std::min_element(sums, sums + kShifts) - sums);
  if (best == 0 || best == kShifts - 1) return false;  // the minimum may lie further out

  const float before = static_cast<float>(sums[best - 1]);
  const float at = static_cast<float>(sums[best]);
  const float after = static_cast<float>(sums[best + 1]);
  const float delta = (before - after) / (2.0F * (before + after - 2.0F * at));
  refined.right_u = placement.x.to_image(static_cast<float>(x_right) +
                                         static_cast<float>(best - kHalfSearch) + delta);
  refined.sad = sums[best];
  return true;
}

std::vector<LevelPlacement> placements_of(const ImagePyramid& pyramid, const ScalePyramid& scales) {
  const ImageSize size{pyramid.levels[0].cols, pyramid.levels[0].rows};
  std::vector<LevelPlacement> placements;
  placements.reserve(pyramid.levels.size());
  for (int level = 0; level < static_cast<int>(pyramid.levels.size()); ++level) {
    placements.emplace_back(scales, level, size);
  }
  return placements;
}

// Removes the matches whose windows differ much more than those of the typical match.
void remove_outliers(std::vector<std::pair<int, std::uint32_t>>& sads, StereoMatches& matches) {
  if (sads.empty()) return;
  std::sort(sads.begin(), sads.end());
  const float limit = kOutlierFactor * static_cast<float>(sads[sads.size() / 2].first);
  for (auto pair = sads.rbegin(); pair != sads.rend(); ++pair) {
    // Equal windows are never an outlier, also where half of all windows are equal.
    if (pair->first == 0 || static_cast<float>(pair->first) < limit) break;
    matches.right_u[pair->second] = kUnmatched;
    matches.depth[pair->second] = kUnmatched;
  }
}

}  // namespace

void check_extraction(const Extraction& extraction, const ScalePyramid& scales, const char* side) {
  const auto levels = static_cast<int>(extraction.pyramid.levels.size());
  const auto fail = [side](const std::string& text) {
    throw ImageError(std::string(side) + " extraction: " + text);
  };
  if (levels == 0) fail("no image pyramid; keep the one the extractor returns");
  if (levels > scales.levels()) fail("more pyramid levels than scale factors");
  if (extraction.features.descriptors.size() != extraction.features.size()) {
    fail("keypoints and descriptors differ in number");
  }
  for (const cv::Mat& image : extraction.pyramid.levels) {
    if (image.type() != CV_8UC1) fail("pyramid images must be grey, uint8");
  }
  for (const Keypoint& keypoint : extraction.features.keypoints) {
    if (keypoint.level < 0 || keypoint.level >= levels) {
      fail("keypoint on level " + std::to_string(keypoint.level) + " of " + std::to_string(levels));
    }
  }
}

StereoMatches match_stereo(const Extraction& left, const Extraction& right,
                           const ScalePyramid& scales, double bf, double max_disparity) {
  check_extraction(left, scales, "left");
  check_extraction(right, scales, "right");
  if (left.pyramid.levels.size() != right.pyramid.levels.size()) {
    throw ImageError("left and right pyramid have different numbers of levels");
  }
  const std::vector<Keypoint>& keypoints = left.features.keypoints;
  const float max_d = static_cast<float>(max_disparity);
  const float bf32 = static_cast<float>(bf);
  const int rows = left.pyramid.levels[0].rows;
  const auto placements = placements_of(left.pyramid, scales);
  const RowTable table(right.features.keypoints, scales, rows);
  const stereo::ShiftedSad shifted_sad = stereo::shifted_sad_for(best_vector_unit());

  StereoMatches matches;
  matches.right_u.assign(keypoints.size(), kUnmatched);
  matches.depth.assign(keypoints.size(), kUnmatched);
  std::vector<std::pair<int, std::uint32_t>> sads;
  sads.reserve(keypoints.size());
  stereo::WindowPair windows{};
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const Keypoint& keypoint = keypoints[i];
    if (!(keypoint.x >= 0.0F && keypoint.y >= 0.0F && keypoint.y < static_cast<float>(rows))) {
      continue;
    }
    const std::uint32_t match = most_similar(keypoint, left.features.descriptors[i], table,
                                             right.features.descriptors, max_d);
    if (match == kNoMatch) continue;
    Refined refined{};
    if (!refine(keypoint, right.features.keypoints[match].x, left.pyramid, right.pyramid,
                placements, shifted_sad, windows, refined)) {
      continue;
    }
    float disparity = keypoint.x - refined.right_u;
    if (!(disparity >= 0.0F && disparity < max_d)) continue;
    if (disparity <= 0.0F) {
      disparity = kSmallestDisparity;
      refined.right_u = keypoint.x - kSmallestDisparity;
    }
    matches.right_u[i] = refined.right_u;
    matches.depth[i] = bf32 / disparity;
    sads.emplace_back(refined.sad, static_cast<std::uint32_t>(i));
  }
  remove_outliers(sads, matches);
  return matches;
}

}  // namespace orbslam
