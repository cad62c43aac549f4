// SPDX-License-Identifier: BSD-3-Clause
#include "frame/sharpness.hpp"

#include <algorithm>
#include <functional>
#include <numeric>
#include <vector>

namespace orbslam {
namespace {

constexpr int kFineLevels = 2;
constexpr int kFirstCoarseLevel = 4;

}  // namespace

double sharpness(const Frame& frame, std::size_t n_usual) {
  std::vector<float> responses;
  responses.reserve(frame.keypoints.size());
  for (const Keypoint& keypoint : frame.keypoints) {
    if (keypoint.level < kFineLevels) responses.push_back(keypoint.response);
  }
  if (frame.keypoints.size() > n_usual) {
    const std::size_t n = responses.size() * n_usual / frame.keypoints.size();
    // In any order: they are whole numbers, whose sum is exact.
    std::nth_element(responses.begin(), responses.begin() + static_cast<std::ptrdiff_t>(n),
                     responses.end(), std::greater<>());
    responses.resize(n);
  }
  return std::accumulate(responses.begin(), responses.end(), 0.0);
}

double fine_detail(const Frame& frame) {
  double fine = 0;
  double coarse = 0;
  int n_fine = 0;
  int n_coarse = 0;
  for (const Keypoint& keypoint : frame.keypoints) {
    const auto response = static_cast<double>(keypoint.response);
    if (keypoint.level < kFineLevels) {
      fine += response;
      ++n_fine;
    } else if (keypoint.level >= kFirstCoarseLevel) {
      coarse += response;
      ++n_coarse;
    }
  }
  if (n_fine == 0 || coarse <= 0) return 0;
  return (fine / n_fine) / (coarse / n_coarse);
}

}  // namespace orbslam
