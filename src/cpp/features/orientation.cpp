// SPDX-License-Identifier: BSD-3-Clause
#include "features/orientation.hpp"

#include <algorithm>
#include <cmath>

namespace orbslam {

float fast_atan2_degrees(float y, float x) {
  constexpr float degrees = static_cast<float>(180.0 / 3.1415926535897932384626433832795);
  constexpr float p1 = 0.9997878412794807F * degrees;
  constexpr float p3 = -0.3258083974640975F * degrees;
  constexpr float p5 = 0.1555786518463281F * degrees;
  constexpr float p7 = -0.04432655554792128F * degrees;
  const float ax = std::abs(x), ay = std::abs(y);
  const float ratio = std::min(ax, ay) / (std::max(ax, ay) + 2.2204460492503131e-16F);
  const float square = ratio * ratio;
  float angle = (((p7 * square + p5) * square + p3) * square + p1) * ratio;
  if (ax < ay) angle = 90.0F - angle;
  if (x < 0) angle = 180.0F - angle;
  if (y < 0) angle = 360.0F - angle;
  return angle;
}

}  // namespace orbslam
