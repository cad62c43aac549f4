// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstring>

#include "features/kernels.hpp"
#include "features/orb_pattern.hpp"

namespace orbslam {
namespace {

/// The circle of radius 3 around a pixel, in order.
constexpr int circle[16][2] = {{0, 3},  {1, 3},  {2, 2},  {3, 1},   {3, 0},   {3, -1},
                               {2, -2}, {1, -3}, {0, -3}, {-1, -3}, {-2, -2}, {-3, -1},
                               {-3, 0}, {-3, 1}, {-2, 2}, {-1, 3}};

/// 16 neighbouring pixels. Loops over them are written so that compilers turn them into single
/// instructions of whatever vector set the processor has.
struct Lanes {
  std::uint8_t at[16];
};

Lanes load(const std::uint8_t* p) {
  Lanes lanes;
  std::memcpy(lanes.at, p, sizeof(lanes.at));
  return lanes;
}

Lanes lower(const Lanes& a, const Lanes& b) {
  Lanes out;
  for (int i = 0; i < 16; ++i) out.at[i] = a.at[i] < b.at[i] ? a.at[i] : b.at[i];
  return out;
}

Lanes higher(const Lanes& a, const Lanes& b) {
  Lanes out;
  for (int i = 0; i < 16; ++i) out.at[i] = a.at[i] > b.at[i] ? a.at[i] : b.at[i];
  return out;
}

/// a - b, or 0 where that would be negative.
Lanes excess(const Lanes& a, const Lanes& b) {
  Lanes out = higher(a, b);
  for (int i = 0; i < 16; ++i) out.at[i] = static_cast<std::uint8_t>(out.at[i] - b.at[i]);
  return out;
}

/// Of each lane: the outermost over all arcs of 9 circle pixels of the innermost in the arc. With
/// (lower, higher) the brightest arc, with (higher, lower) the darkest one.
template <Lanes (*inner)(const Lanes&, const Lanes&), Lanes (*outer)(const Lanes&, const Lanes&)>
Lanes best_arc(const Lanes pixel[16]) {
  // Over 2, 4, then 8 neighbours that start at odd positions; the arcs e..e+8 and e+1..e+9
  // (e even) share the 8 from e+1 on.
  Lanes two[8], four[8];
  for (int k = 0; k < 8; ++k) two[k] = inner(pixel[2 * k + 1], pixel[(2 * k + 2) & 15]);
  for (int k = 0; k < 8; ++k) four[k] = inner(two[k], two[(k + 1) & 7]);
  Lanes best{};
  for (int k = 0; k < 8; ++k) {
    const Lanes eight = inner(four[k], four[(k + 2) & 7]);
    const Lanes arc = inner(eight, outer(pixel[2 * k], pixel[(2 * k + 9) & 15]));
    best = k == 0 ? arc : outer(best, arc);
  }
  return best;
}

/// Score: the largest t such that 9 neighbours on the circle all exceed the centre by more than t,
/// or all fall below it by more than t.
void fast_scores_16(const std::uint8_t* centre, const std::ptrdiff_t offsets[16], int threshold,
                    std::uint8_t* scores) {
  const Lanes value = load(centre);
  const Lanes south = load(centre + offsets[0]), east = load(centre + offsets[4]);
  const Lanes north = load(centre + offsets[8]), west = load(centre + offsets[12]);
  // 9 of 16 neighbours contain two adjacent ones of the four compass points, so these bound the
  // score from above.
  const Lanes bright_bound = excess(lower(higher(south, north), higher(east, west)), value);
  const Lanes dark_bound = excess(value, higher(lower(south, north), lower(east, west)));
  const Lanes bound = higher(bright_bound, dark_bound);
  unsigned any = 0;
  for (int i = 0; i < 16; ++i) any |= static_cast<unsigned>(bound.at[i] > threshold);
  if (any == 0) {
    std::memset(scores, 0, 16);
    return;
  }
  Lanes pixel[16];
  for (int k = 0; k < 16; ++k) pixel[k] = load(centre + offsets[k]);
  const Lanes best = higher(excess(best_arc<lower, higher>(pixel), value),
                            excess(value, best_arc<higher, lower>(pixel)));
  for (int i = 0; i < 16; ++i) {
    scores[i] = static_cast<std::uint8_t>(best.at[i] > threshold ? best.at[i] - 1 : 0);
  }
}

void fast_scores(const std::uint8_t* centre, std::ptrdiff_t stride, int count, int threshold,
                 std::uint8_t* scores) {
  std::ptrdiff_t offsets[16];
  for (int k = 0; k < 16; ++k) offsets[k] = circle[k][1] * stride + circle[k][0];
  if (count >= 16) {
    for (int i = 0; i < count; i += 16) {
      const int begin = i + 16 <= count ? i : count - 16;  // the last run may overlap
      fast_scores_16(centre + begin, offsets, threshold, scores + begin);
    }
    return;
  }
  // Too short for a run: the 7 rows around the pixels are copied to where a run may be read.
  std::uint8_t window[7 * 24] = {}, run[16];
  for (int y = 0; y < 7; ++y) {
    std::memcpy(window + 24 * y, centre + (y - 3) * stride - 3,
                static_cast<std::size_t>(count + 6));
  }
  for (int k = 0; k < 16; ++k) offsets[k] = circle[k][1] * 24 + circle[k][0];
  fast_scores_16(window + 3 * 24 + 3, offsets, threshold, run);
  std::memcpy(scores, run, static_cast<std::size_t>(count));
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

// The taps are symmetric; folding them halves the multiplications.
void blur_row(const std::uint8_t* padded, int count, std::uint16_t* out) {
  for (int i = 0; i < count; ++i) {
    const std::uint8_t* p = padded + i;
    // At most 256 * 255, which fits.
    out[i] =
        static_cast<std::uint16_t>(blur_taps[0] * (p[0] + p[6]) + blur_taps[1] * (p[1] + p[5]) +
                                   blur_taps[2] * (p[2] + p[4]) + blur_taps[3] * p[3]);
  }
}

void blur_columns(const std::uint16_t* const rows[7], int count, std::uint8_t* out) {
  const std::uint16_t *r0 = rows[0], *r1 = rows[1], *r2 = rows[2], *r3 = rows[3];
  const std::uint16_t *r4 = rows[4], *r5 = rows[5], *r6 = rows[6];
  for (int i = 0; i < count; ++i) {
    const int sum = blur_taps[0] * (r0[i] + r6[i]) + blur_taps[1] * (r1[i] + r5[i]) +
                    blur_taps[2] * (r2[i] + r4[i]) + blur_taps[3] * r3[i];
    out[i] = static_cast<std::uint8_t>((sum + (1 << 15)) >> 16);
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
