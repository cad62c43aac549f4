// SPDX-License-Identifier: BSD-3-Clause
#include "frame/sharpness.hpp"

namespace orbslam {
namespace {

constexpr int kFineLevels = 2;
constexpr int kFirstCoarseLevel = 4;

}  // namespace

double sharpness(const Frame& frame) {
  double sum = 0;
  for (const Keypoint& keypoint : frame.keypoints) {
    if (keypoint.level < kFineLevels) sum += static_cast<double>(keypoint.response);
  }
  return sum;
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
