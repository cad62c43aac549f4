// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "features/kernels.hpp"
#include "features/orb_pattern.hpp"

namespace orbslam {
namespace {

/// The circle of radius 3 around a pixel, in order.
constexpr int circle[16][2] = {{0, 3},  {1, 3},  {2, 2},  {3, 1},   {3, 0},   {3, -1},
                               {2, -2}, {1, -3}, {0, -3}, {-1, -3}, {-2, -2}, {-3, -1},
                               {-3, 0}, {-3, 1}, {-2, 2}, {-1, 3}};

/// The largest t such that 9 neighbours on the circle all exceed the centre by more than t, or all
/// fall below it by more than t.
int fast_score(const std::uint8_t* centre, const std::ptrdiff_t offsets[16]) {
  int difference[25];
  for (int k = 0; k < 16; ++k) difference[k] = centre[offsets[k]] - *centre;
  std::copy_n(difference, 9, difference + 16);
  int best = 0;
  // Two arcs that overlap in 8 pixels share the extrema of those.
  for (int k = 0; k < 16; k += 2) {
    const auto [low, high] = std::minmax_element(difference + k + 1, difference + k + 9);
    const int first = difference[k], last = difference[k + 9];
    best = std::max(
        {best, std::min(*low, std::max(first, last)), -std::max(*high, std::min(first, last))});
  }
  return best - 1;
}

void fast_scores(const std::uint8_t* centre, std::ptrdiff_t stride, int count, int threshold,
                 std::uint8_t* scores) {
  std::ptrdiff_t offsets[16];
  for (int k = 0; k < 16; ++k) offsets[k] = circle[k][1] * stride + circle[k][0];
  for (int i = 0; i < count; ++i, ++centre) {
    // 9 of 16 neighbours contain two adjacent ones of the four compass points.
    const int low = *centre - threshold, high = *centre + threshold;
    const int south = centre[offsets[0]], east = centre[offsets[4]];
    const int north = centre[offsets[8]], west = centre[offsets[12]];
    const bool bright = (south > high || north > high) && (east > high || west > high);
    const bool dark = (south < low || north < low) && (east < low || west < low);
    scores[i] = 0;
    if (!bright && !dark) continue;
    const int score = fast_score(centre, offsets);
    if (score >= threshold) scores[i] = static_cast<std::uint8_t>(score);
  }
}

int local_maxima(const std::uint8_t* scores, std::ptrdiff_t stride, int width, int height,
                 Corner* out) {
  int n = 0;
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* row = scores + y * stride;
    for (int x = 0; x < width; ++x) {
      const std::uint8_t* p = row + x;
      if (*p == 0) continue;
      const std::uint8_t* up = p - stride;
      const std::uint8_t* down = p + stride;
      if (*p > std::max({p[-1], p[1], up[-1], up[0], up[1], down[-1], down[0], down[1]})) {
        out[n++] = {static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y), *p};
      }
    }
  }
  return n;
}

void resize_row(const std::uint8_t* source, const ResizeColumns& columns, std::int16_t* out) {
  for (int i = 0; i < columns.count; ++i) {
    const std::uint8_t* pixel = source + columns.index[i];
    const int sum = pixel[0] * columns.weights[2 * i] + pixel[1] * columns.weights[2 * i + 1];
    out[i] = static_cast<std::int16_t>(sum >> 4);
  }
}

void resize_blend(const std::int16_t* upper, const std::int16_t* lower, int upper_weight,
                  int lower_weight, int count, std::uint8_t* out) {
  for (int i = 0; i < count; ++i) {
    const int sum = ((upper_weight * upper[i]) >> 16) + ((lower_weight * lower[i]) >> 16);
    out[i] = static_cast<std::uint8_t>((sum + 2) >> 2);
  }
}

void blur_row(const std::uint8_t* padded, int count, std::uint16_t* out) {
  for (int i = 0; i < count; ++i) {
    int sum = 0;
    for (int k = 0; k < 7; ++k) sum += blur_taps[k] * padded[i + k];
    out[i] = static_cast<std::uint16_t>(sum);
  }
}

void blur_columns(const std::uint16_t* const rows[7], int count, std::uint8_t* out) {
  for (int i = 0; i < count; ++i) {
    int sum = 1 << 15;
    for (int k = 0; k < 7; ++k) sum += blur_taps[k] * rows[k][i];
    out[i] = static_cast<std::uint8_t>(sum >> 16);
  }
}

void moments(const std::uint8_t* centre, std::ptrdiff_t stride, std::int32_t* m10,
             std::int32_t* m01) {
  int sum_u = 0, sum_v = 0;
  for (int v = -disc_radius; v <= disc_radius; ++v) {
    const std::uint8_t* row = centre + v * stride;
    const int half = disc_half_length[std::abs(v)];
    int row_sum = 0;
    for (int u = -half; u <= half; ++u) {
      sum_u += u * row[u];
      row_sum += row[u];
    }
    sum_v += v * row_sum;
  }
  *m10 = sum_u;
  *m01 = sum_v;
}

/// Nearest integer, ties to even, which is the default rounding mode.
int round_half_even(float value) { return static_cast<int>(std::nearbyintf(value)); }

std::uint8_t sample(const std::uint8_t* centre, std::ptrdiff_t stride, float x, float y,
                    float cosine, float sine) {
  // Every product is rounded to float32 before the sum: descriptor bits depend on it.
  const float xc = x * cosine, ys = y * sine, xs = x * sine, yc = y * cosine;
  return centre[round_half_even(xs + yc) * stride + round_half_even(xc - ys)];
}

void brief(const std::uint8_t* centre, std::ptrdiff_t stride, float cosine, float sine,
           std::uint8_t* descriptor) {
  const OrbPatternColumns& pattern = orb_pattern_columns;
  for (int byte = 0; byte < 32; ++byte) {
    unsigned bits = 0;
    for (int bit = 0; bit < 8; ++bit) {
      const int i = 8 * byte + bit;
      const int p = sample(centre, stride, pattern.x1[i], pattern.y1[i], cosine, sine);
      const int q = sample(centre, stride, pattern.x2[i], pattern.y2[i], cosine, sine);
      bits |= static_cast<unsigned>(p < q) << bit;
    }
    descriptor[byte] = static_cast<std::uint8_t>(bits);
  }
}

}  // namespace

const Kernels& portable_kernels() {
  static constexpr Kernels kernels = {"portable",   fast_scores,  local_maxima,
                                      resize_row,   resize_blend, blur_row,
                                      blur_columns, moments,      brief};
  return kernels;
}

}  // namespace orbslam
