// SPDX-License-Identifier: BSD-3-Clause
#include "frame/sharpness.hpp"

namespace orbslam {
namespace {

constexpr int kFineLevels = 2;

}  // namespace

double sharpness(const Frame& frame) {
  double sum = 0;
  for (const Keypoint& keypoint : frame.keypoints) {
    if (keypoint.level < kFineLevels) sum += static_cast<double>(keypoint.response);
  }
  return sum;
}

}  // namespace orbslam
