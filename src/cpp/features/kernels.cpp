// SPDX-License-Identifier: BSD-3-Clause
#include "features/kernels.hpp"

#include <cstring>

#include "base/vector_targets.hpp"
#include "features/orb_pattern.hpp"

// Highway includes this file once more for every vector unit, and compiles what stands between
// HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE for it: no header may be included in between,
// because the linker could take a function of such a copy for the whole program.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "features/kernels.cpp"
#include <hwy/foreach_target.h>
// Behind it.
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace orbslam {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

/// Vector types: 8-bit pixels that fill a vector, and half as many 16-bit numbers.
using Pixels = hn::ScalableTag<std::uint8_t>;
using PixelVector = hn::Vec<Pixels>;
using Words = hn::ScalableTag<std::int16_t>;
using Integers = hn::ScalableTag<std::int32_t>;
constexpr int n_pixels = static_cast<int>(hn::MaxLanes(Pixels()));
constexpr int n_words = static_cast<int>(hn::MaxLanes(Words()));

/// The circle of radius 3 around a pixel, in order.
constexpr int circle[16][2] = {{0, 3},  {1, 3},  {2, 2},  {3, 1},   {3, 0},   {3, -1},
                               {2, -2}, {1, -3}, {0, -3}, {-1, -3}, {-2, -2}, {-3, -1},
                               {-3, 0}, {-3, 1}, {-2, 2}, {-1, 3}};

struct Lower {
  static HWY_INLINE PixelVector of(PixelVector a, PixelVector b) { return hn::Min(a, b); }
};
struct Higher {
  static HWY_INLINE PixelVector of(PixelVector a, PixelVector b) { return hn::Max(a, b); }
};

/// Per lane: the largest minimum (or smallest maximum) over all arcs of 9 circle pixels. With
/// <Lower, Higher> the brightest arc, with <Higher, Lower> the darkest one.
template <class Inner, class Outer>
HWY_INLINE PixelVector best_arc(const PixelVector (&pixel)[16]) {
  // Over 2, 4, then 8 neighbours that start at odd positions; the arcs e..e+8 and e+1..e+9
  // (e even) share the 8 from e+1 on.
  PixelVector two[8], four[8];
  for (int k = 0; k < 8; ++k) two[k] = Inner::of(pixel[2 * k + 1], pixel[(2 * k + 2) & 15]);
  for (int k = 0; k < 8; ++k) four[k] = Inner::of(two[k], two[(k + 1) & 7]);
  const auto arc = [&](int k) HWY_ATTR {
    const PixelVector eight = Inner::of(four[k], four[(k + 2) & 7]);
    return Inner::of(eight, Outer::of(pixel[2 * k], pixel[(2 * k + 9) & 15]));
  };
  PixelVector best = arc(0);
  for (int k = 1; k < 8; ++k) best = Outer::of(best, arc(k));
  return best;
}

/// FAST scores of `n_pixels` pixels: the largest t such that 9 neighbours on the circle all exceed
/// the centre by more than t, or all fall below it by more than t.
HWY_INLINE PixelVector scores_of_run(const std::uint8_t* centre, const std::ptrdiff_t* offsets,
                                     PixelVector threshold) {
  const Pixels d;
  const PixelVector zero = hn::Zero(d), value = hn::LoadU(d, centre);
  const PixelVector south = hn::LoadU(d, centre + offsets[0]);
  const PixelVector east = hn::LoadU(d, centre + offsets[4]);
  const PixelVector north = hn::LoadU(d, centre + offsets[8]);
  const PixelVector west = hn::LoadU(d, centre + offsets[12]);
  // 9 of 16 neighbours contain two adjacent ones of the four compass points, so these bound the
  // score from above.
  const PixelVector bright_bound =
      hn::SaturatedSub(hn::Min(hn::Max(south, north), hn::Max(east, west)), value);
  const PixelVector dark_bound =
      hn::SaturatedSub(value, hn::Max(hn::Min(south, north), hn::Min(east, west)));
  const PixelVector excess = hn::SaturatedSub(hn::Max(bright_bound, dark_bound), threshold);
  if (hn::AllTrue(d, hn::Eq(excess, zero))) return zero;

  PixelVector pixel[16];
  for (int k = 0; k < 16; ++k) pixel[k] = hn::LoadU(d, centre + offsets[k]);
  const PixelVector best = hn::Max(hn::SaturatedSub(best_arc<Lower, Higher>(pixel), value),
                                   hn::SaturatedSub(value, best_arc<Higher, Lower>(pixel)));
  const auto no_corner = hn::Eq(hn::SaturatedSub(best, threshold), zero);
  return hn::IfThenZeroElse(no_corner, hn::Sub(best, hn::Set(d, 1)));
}

void fast_scores(const std::uint8_t* centre, std::ptrdiff_t stride, int count, int threshold,
                 std::uint8_t* scores) {
  const Pixels d;
  const PixelVector limit = hn::Set(d, static_cast<std::uint8_t>(threshold));
  std::ptrdiff_t offsets[16];
  if (count >= n_pixels) {
    for (int k = 0; k < 16; ++k) offsets[k] = circle[k][1] * stride + circle[k][0];
    for (int i = 0; i < count; i += n_pixels) {
      const int begin = i + n_pixels <= count ? i : count - n_pixels;  // the last run may overlap
      hn::StoreU(scores_of_run(centre + begin, offsets, limit), d, scores + begin);
    }
    return;
  }
  // Too short for a run: the 7 rows around the pixels are copied to where a run may be read.
  constexpr int row = n_pixels + 6;
  std::uint8_t window[7 * row] = {}, run[n_pixels];
  for (int y = 0; y < 7; ++y) {
    std::memcpy(window + row * y, centre + (y - 3) * stride - 3,
                static_cast<std::size_t>(count + 6));
  }
  for (int k = 0; k < 16; ++k) offsets[k] = circle[k][1] * row + circle[k][0];
  hn::StoreU(scores_of_run(window + 3 * row + 3, offsets, limit), d, run);
  std::memcpy(scores, run, static_cast<std::size_t>(count));
}

/// One bit for each of the pixels that exceed all 8 neighbours.
HWY_INLINE std::uint64_t maxima_of_run(const std::uint8_t* row, std::ptrdiff_t stride) {
  const Pixels d;
  const PixelVector centre = hn::LoadU(d, row);
  if (hn::AllTrue(d, hn::Eq(centre, hn::Zero(d)))) return 0;
  const auto three = [&](const std::uint8_t* p) HWY_ATTR {
    return hn::Max(hn::Max(hn::LoadU(d, p - 1), hn::LoadU(d, p)), hn::LoadU(d, p + 1));
  };
  const PixelVector beside = hn::Max(hn::LoadU(d, row - 1), hn::LoadU(d, row + 1));
  const PixelVector around = hn::Max(beside, hn::Max(three(row - stride), three(row + stride)));
  const auto not_above = hn::Eq(hn::Max(around, centre), around);
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(d, not_above, bytes);
  std::uint64_t bits = 0;
  for (int k = 0; k < n_pixels / 8; ++k) bits |= static_cast<std::uint64_t>(bytes[k]) << (8 * k);
  return ~bits;
}

int local_maxima(const std::uint8_t* scores, std::ptrdiff_t stride, int width, int height,
                 Corner* out) {
  int n = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; x += n_pixels) {
      std::uint64_t bits = maxima_of_run(scores + y * stride + x, stride);
      const int pixels = width - x < n_pixels ? width - x : n_pixels;
      if (pixels < 64) bits &= (std::uint64_t{1} << pixels) - 1;
      for (; bits != 0; bits &= bits - 1) {
        const int column = x + __builtin_ctzll(bits);
        out[n++] = {static_cast<std::uint16_t>(column), static_cast<std::uint16_t>(y),
                    scores[y * stride + column]};
      }
    }
  }
  return n;
}

/// Sums of neighbouring products, in units of 1/16 of them.
template <class D16>
HWY_INLINE hn::Vec<hn::RepartitionToWide<D16>> weighted_pairs(D16 d16, hn::Vec<D16> pairs,
                                                              const std::int16_t* weights) {
  const hn::RepartitionToWide<D16> d32;
  auto odd = hn::Zero(d32);
  const auto even =
      hn::ReorderWidenMulAccumulate(d32, pairs, hn::LoadU(d16, weights), hn::Zero(d32), odd);
  return hn::ShiftRight<4>(hn::RearrangeToOddPlusEven(even, odd));
}

void resize_row(const std::uint8_t* source, const ResizeColumns& columns, std::int16_t* out) {
  if (columns.block_begin == nullptr) {
    for (int i = 0; i < columns.count; ++i) {
      const std::uint8_t* pixel = source + columns.index[i];
      const int sum = pixel[0] * columns.weights[2 * i] + pixel[1] * columns.weights[2 * i + 1];
      out[i] = static_cast<std::int16_t>(sum >> 4);
    }
    return;
  }
  const hn::FixedTag<std::uint8_t, 16> d8;
  const hn::FixedTag<std::int16_t, 8> columns16;
  const hn::CappedTag<std::int16_t, 16> d16;
  const int blocks = (columns.count + 7) / 8;
  for (int b = 0; b < blocks; ++b) {
    const auto pairs = hn::TableLookupBytes(hn::LoadU(d8, source + columns.block_begin[b]),
                                            hn::LoadU(d8, columns.block_shuffle + 16 * b));
    const std::int16_t* weights = columns.weights + 16 * b;
#if HWY_CAP_GE256
    const auto sums = weighted_pairs(d16, hn::PromoteTo(d16, pairs), weights);
    hn::StoreU(hn::DemoteTo(columns16, sums), columns16, out + 8 * b);
#else
    const auto zero = hn::Zero(d8);  // 4 columns at a time
    const auto first = hn::BitCast(d16, hn::InterleaveLower(d8, pairs, zero));
    const auto second = hn::BitCast(d16, hn::InterleaveUpper(d8, pairs, zero));
    hn::StoreU(hn::ReorderDemote2To(columns16, weighted_pairs(d16, first, weights),
                                    weighted_pairs(d16, second, weights + 8)),
               columns16, out + 8 * b);
#endif
  }
}

void resize_blend(const std::int16_t* upper, const std::int16_t* lower, int upper_weight,
                  int lower_weight, int count, std::uint8_t* out) {
  const Words d;
  const hn::Rebind<std::uint8_t, Words> d8;
  if (count < n_words) {
    for (int i = 0; i < count; ++i) {
      const int sum = ((upper_weight * upper[i]) >> 16) + ((lower_weight * lower[i]) >> 16);
      out[i] = static_cast<std::uint8_t>((sum + 2) >> 2);
    }
    return;
  }
  const auto a = hn::Set(d, static_cast<std::int16_t>(upper_weight));
  const auto b = hn::Set(d, static_cast<std::int16_t>(lower_weight));
  const auto half = hn::Set(d, 2);
  for (int i = 0; i < count; i += n_words) {
    const int begin = i + n_words <= count ? i : count - n_words;
    const auto sum = hn::Add(hn::MulHigh(hn::LoadU(d, upper + begin), a),
                             hn::MulHigh(hn::LoadU(d, lower + begin), b));
    hn::StoreU(hn::DemoteTo(d8, hn::ShiftRight<2>(hn::Add(sum, half))), d8, out + begin);
  }
}

void blur_columns(const std::uint8_t* const rows[7], int count, std::int16_t* sums) {
  const hn::RebindToUnsigned<Words> d;
  const hn::Rebind<std::uint8_t, Words> d8;
  if (count < n_words) {
    for (int i = 0; i < count; ++i) {
      int sum = -32768;
      for (int k = 0; k < 7; ++k) sum += blur_taps[k] * rows[k][i];
      sums[i] = static_cast<std::int16_t>(sum);
    }
    return;
  }
  for (int i = 0; i < count; i += n_words) {
    const int begin = i + n_words <= count ? i : count - n_words;
    const auto row = [&](int k)
                         HWY_ATTR { return hn::PromoteTo(d, hn::LoadU(d8, rows[k] + begin)); };
    // The taps are symmetric; folding them halves the multiplications. At most 256 * 255, which
    // fits.
    const auto outer = hn::Add(hn::Mul(hn::Add(row(0), row(6)), hn::Set(d, blur_taps[0])),
                               hn::Mul(hn::Add(row(1), row(5)), hn::Set(d, blur_taps[1])));
    const auto inner = hn::Add(hn::Mul(hn::Add(row(2), row(4)), hn::Set(d, blur_taps[2])),
                               hn::Mul(row(3), hn::Set(d, blur_taps[3])));
    const auto sum = hn::Xor(hn::Add(outer, inner), hn::Set(d, 0x8000));
    hn::StoreU(hn::BitCast(Words(), sum), Words(), sums + begin);
  }
}

/// Weighted sums over 7 neighbours for every other one from `sums` + 3 on, in units of 1/65536.
HWY_INLINE hn::Vec<Integers> blur_every_other(const std::int16_t* sums) {
  const Words d16;
  const Integers d32;
  // Two neighbours at a time, multiplied by two taps.
  auto low = hn::Zero(d32), high = hn::Zero(d32);
  const auto add = [&](int k, int first, int second) HWY_ATTR {
    const auto taps = hn::BitCast(d16, hn::Set(d32, second << 16 | first));
    low = hn::ReorderWidenMulAccumulate(d32, hn::LoadU(d16, sums + k), taps, low, high);
  };
  add(0, blur_taps[0], blur_taps[1]);
  add(2, blur_taps[2], blur_taps[3]);
  add(4, blur_taps[4], blur_taps[5]);
  add(6, blur_taps[6], 0);
  // The sums were stored minus 32768, and the taps add up to 256. The rounding constant adds 256 *
  // 32768 back.
  return hn::Add(hn::RearrangeToOddPlusEven(low, high), hn::Set(d32, (256 << 15) + (1 << 15)));
}

void blur_row(const std::int16_t* sums, int count, std::uint8_t* out) {
  const Words d16;
  const hn::Rebind<std::uint8_t, Words> d8;
  const Integers d32;
  const hn::RebindToUnsigned<Integers> du32;
  for (int i = 0; i < count; i += n_words) {
    const auto even = hn::ShiftRight<16>(hn::BitCast(du32, blur_every_other(sums + i)));
    const auto odd = hn::And(blur_every_other(sums + i + 1), hn::Set(d32, -65536));
    const auto pixels = hn::Or(hn::BitCast(d16, even), hn::BitCast(d16, odd));
    hn::StoreU(hn::DemoteTo(d8, pixels), d8, out + i);
  }
}

/// Rows of the disc: its pixels as a mask. Of the columns their numbers (0 outside), even ones
/// first.
struct Disc {
  alignas(32) std::uint8_t mask[disc_radius + 1][32];
  alignas(32) std::int16_t even[16], odd[16];
};

constexpr Disc make_disc() {
  Disc disc{};
  for (int v = 0; v <= disc_radius; ++v) {
    for (int u = -disc_half_length[v]; u <= disc_half_length[v]; ++u) {
      disc.mask[v][u + disc_radius] = 0xFF;
    }
  }
  for (int k = 0; k < 16; ++k) {
    disc.even[k] = static_cast<std::int16_t>(2 * k - disc_radius);
    disc.odd[k] = static_cast<std::int16_t>(k < 15 ? 2 * k + 1 - disc_radius : 0);
  }
  return disc;
}

constexpr Disc disc = make_disc();

void moments(const std::uint8_t* centre, std::ptrdiff_t stride, std::int32_t* m10,
             std::int32_t* m01) {
  const hn::CappedTag<std::uint8_t, 32> d8;
  const hn::Repartition<std::uint16_t, decltype(d8)> d16;
  const hn::RebindToSigned<decltype(d16)> signed16;
  const hn::RepartitionToWide<decltype(signed16)> d32;
  const hn::Repartition<std::uint64_t, decltype(d8)> d64;
  constexpr int width = static_cast<int>(hn::MaxLanes(d8));
  auto sum_u = hn::Zero(d32), sum_u_more = hn::Zero(d32);
  auto sum_v = hn::Zero(d64);
  for (int part = 0; part < 32; part += width) {
    const std::uint8_t* left = centre - disc_radius + part;
    const auto masked = [&](int v, int row) HWY_ATTR {
      return hn::And(hn::LoadU(d8, left + row * stride), hn::Load(d8, disc.mask[v] + part));
    };
    // Sums of columns: of the odd ones, and of both as they stand, modulo 65536.
    auto both = hn::BitCast(d16, masked(0, 0));
    auto odd = hn::ShiftRight<8>(both);
    // sum over v of v d(v) = sum over k of the partial sums d(15) + ... + d(k).
    auto partial = hn::Zero(d64);
    for (int v = disc_radius; v >= 1; --v) {
      const auto below = masked(v, v), above = masked(v, -v);
      partial = hn::Add(partial, hn::Sub(hn::SumsOf8(below), hn::SumsOf8(above)));
      sum_v = hn::Add(sum_v, partial);
      const auto below16 = hn::BitCast(d16, below), above16 = hn::BitCast(d16, above);
      both = hn::Add(both, hn::Add(below16, above16));
      odd = hn::Add(odd, hn::Add(hn::ShiftRight<8>(below16), hn::ShiftRight<8>(above16)));
    }
    const auto even = hn::Sub(both, hn::ShiftLeft<8>(odd));
    sum_u =
        hn::ReorderWidenMulAccumulate(d32, hn::BitCast(signed16, even),
                                      hn::Load(signed16, disc.even + part / 2), sum_u, sum_u_more);
    sum_u =
        hn::ReorderWidenMulAccumulate(d32, hn::BitCast(signed16, odd),
                                      hn::Load(signed16, disc.odd + part / 2), sum_u, sum_u_more);
  }
  *m10 = hn::GetLane(hn::SumOfLanes(d32, hn::Add(sum_u, sum_u_more)));
  *m01 = static_cast<std::int32_t>(hn::GetLane(hn::SumOfLanes(d64, sum_v)));
}

/// Where rotated points lie, in bytes from the centre. Each product is rounded to float32 before
/// the sum, descriptor bits depend on it: this file is compiled without fused multiply-add.
HWY_INLINE void rotated_offsets(const float* x, const float* y, float cosine, float sine,
                                std::ptrdiff_t stride, std::int32_t* offsets) {
  const hn::CappedTag<float, 8> d;
  const hn::RebindToSigned<decltype(d)> d32;
  const auto c = hn::Set(d, cosine), s = hn::Set(d, sine);
  const auto step = hn::Set(d32, static_cast<std::int32_t>(stride));
  // Added to a small number, this rounds it to the nearest integer, half to even, which is then in
  // the lowest bits. (NearestInt has to care for large numbers.)
  const auto round = hn::Set(d, 12582912.0F);
  const auto bits_of_round = hn::BitCast(d32, round);
  const auto rounded = [&](auto value) HWY_ATTR {
    return hn::Sub(hn::BitCast(d32, hn::Add(value, round)), bits_of_round);
  };
  for (std::size_t i = 0; i < 256; i += hn::MaxLanes(d)) {
    const auto px = hn::Load(d, x + i), py = hn::Load(d, y + i);
    const auto column = rounded(hn::Sub(hn::Mul(px, c), hn::Mul(py, s)));
    const auto row = rounded(hn::Add(hn::Mul(px, s), hn::Mul(py, c)));
    hn::Store(hn::Add(hn::Mul(row, step), column), d32, offsets + i);
  }
}

void brief(const std::uint8_t* centre, std::ptrdiff_t stride, float cosine, float sine,
           std::uint8_t* descriptor) {
  const OrbPatternColumns& pattern = orb_pattern_columns;
  alignas(32) std::int32_t first[256], second[256];
  rotated_offsets(pattern.x1, pattern.y1, cosine, sine, stride, first);
  rotated_offsets(pattern.x2, pattern.y2, cosine, sine, stride, second);
  for (int word = 0; word < 8; ++word) {
    std::uint32_t bits = 0;
#pragma GCC unroll 8
    for (int i = 32 * word + 31; i >= 32 * word; --i) {
      bits += bits + (centre[first[i]] < centre[second[i]]);
    }
    std::memcpy(descriptor + 4 * word, &bits, 4);
  }
}

}  // namespace

extern const Kernels kernels;
const Kernels kernels = {fast_scores,  local_maxima, resize_row, resize_blend,
                         blur_columns, blur_row,     moments,    brief};

}  // namespace HWY_NAMESPACE
}  // namespace orbslam
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace orbslam {

const Kernels& kernels_for(VectorUnit unit) {
  const Kernels* found = nullptr;
  if (unit == VectorUnit::avx2) found = HWY_CHOOSE_AVX2(kernels);
  if (unit == VectorUnit::avx512) found = HWY_CHOOSE_AVX3(kernels);
  return found != nullptr ? *found : HWY_STATIC_DISPATCH(kernels);
}

}  // namespace orbslam
#endif
