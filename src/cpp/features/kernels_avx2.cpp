// SPDX-License-Identifier: BSD-3-Clause
#include "features/kernels.hpp"
#include "features/orb_pattern.hpp"

// Compiled with -mavx2: no header with inline functions or templates may be added here
// (see kernels.hpp).

#if defined(__AVX2__)

#include <immintrin.h>

namespace orbslam {
namespace {

__m256i load(const void* p) { return _mm256_loadu_si256(static_cast<const __m256i*>(p)); }
void store(void* p, __m256i value) { _mm256_storeu_si256(static_cast<__m256i*>(p), value); }

/// Of each lane: the largest over all arcs of 9 of the smallest of 16 circle pixels.
__m256i brightest_arc(const __m256i pixel[16]) {
  // Minima over 2, 4, then 8 neighbours that start at odd positions; the arcs e..e+8 and
  // e+1..e+9 (e even) share the 8 from e+1 on.
  __m256i two[8], four[8];
  for (int k = 0; k < 8; ++k) {
    two[k] = _mm256_min_epu8(pixel[2 * k + 1], pixel[(2 * k + 2) & 15]);
  }
  for (int k = 0; k < 8; ++k) four[k] = _mm256_min_epu8(two[k], two[(k + 1) & 7]);
  __m256i best = _mm256_setzero_si256();
  for (int k = 0; k < 8; ++k) {
    const __m256i eight = _mm256_min_epu8(four[k], four[(k + 2) & 7]);
    const __m256i end = _mm256_max_epu8(pixel[2 * k], pixel[(2 * k + 9) & 15]);
    best = _mm256_max_epu8(best, _mm256_min_epu8(eight, end));
  }
  return best;
}

/// The same with the roles exchanged: the smallest over all arcs of 9 of the largest pixel.
__m256i darkest_arc(const __m256i pixel[16]) {
  __m256i two[8], four[8];
  for (int k = 0; k < 8; ++k) {
    two[k] = _mm256_max_epu8(pixel[2 * k + 1], pixel[(2 * k + 2) & 15]);
  }
  for (int k = 0; k < 8; ++k) four[k] = _mm256_max_epu8(two[k], two[(k + 1) & 7]);
  __m256i best = _mm256_set1_epi8(-1);
  for (int k = 0; k < 8; ++k) {
    const __m256i eight = _mm256_max_epu8(four[k], four[(k + 2) & 7]);
    const __m256i end = _mm256_min_epu8(pixel[2 * k], pixel[(2 * k + 9) & 15]);
    best = _mm256_min_epu8(best, _mm256_max_epu8(eight, end));
  }
  return best;
}

/// FAST scores of 32 pixels.
__m256i fast_scores_32(const std::uint8_t* centre, const std::ptrdiff_t offsets[16],
                       __m256i threshold) {
  const __m256i zero = _mm256_setzero_si256();
  const __m256i value = load(centre);
  const __m256i south = load(centre + offsets[0]), east = load(centre + offsets[4]);
  const __m256i north = load(centre + offsets[8]), west = load(centre + offsets[12]);
  // 9 of 16 neighbours contain two adjacent ones of the four compass points, so these bound the
  // score from above.
  const __m256i bright_bound = _mm256_subs_epu8(
      _mm256_min_epu8(_mm256_max_epu8(south, north), _mm256_max_epu8(east, west)), value);
  const __m256i dark_bound = _mm256_subs_epu8(
      value, _mm256_max_epu8(_mm256_min_epu8(south, north), _mm256_min_epu8(east, west)));
  const __m256i excess = _mm256_subs_epu8(_mm256_max_epu8(bright_bound, dark_bound), threshold);
  if (_mm256_testz_si256(excess, excess)) return zero;

  __m256i pixel[16];
  for (int k = 0; k < 16; ++k) pixel[k] = load(centre + offsets[k]);
  const __m256i best = _mm256_max_epu8(_mm256_subs_epu8(brightest_arc(pixel), value),
                                       _mm256_subs_epu8(value, darkest_arc(pixel)));
  const __m256i no_corner = _mm256_cmpeq_epi8(_mm256_subs_epu8(best, threshold), zero);
  return _mm256_andnot_si256(no_corner, _mm256_sub_epi8(best, _mm256_set1_epi8(1)));
}

void fast_scores(const std::uint8_t* centre, std::ptrdiff_t stride, int count, int threshold,
                 std::uint8_t* scores) {
  if (count < 32) {
    portable_kernels().fast_scores(centre, stride, count, threshold, scores);
    return;
  }
  const std::ptrdiff_t offsets[16] = {
      3 * stride,  3 * stride + 1,  2 * stride + 2,  stride + 3,
      3,           -stride + 3,     -2 * stride + 2, -3 * stride + 1,
      -3 * stride, -3 * stride - 1, -2 * stride - 2, -stride - 3,
      -3,          stride - 3,      2 * stride - 2,  3 * stride - 1};
  const __m256i limit = _mm256_set1_epi8(static_cast<char>(threshold));
  for (int i = 0; i < count; i += 32) {
    const int begin = i + 32 <= count ? i : count - 32;  // the last run may overlap
    store(scores + begin, fast_scores_32(centre + begin, offsets, limit));
  }
}

int local_maxima(const std::uint8_t* scores, std::ptrdiff_t stride, int width, int height,
                 Corner* out) {
  int n = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; x += 32) {
      const std::uint8_t* row = scores + y * stride + x;
      const __m256i centre = load(row);
      if (_mm256_testz_si256(centre, centre)) continue;
      const std::uint8_t* up = row - stride;
      const std::uint8_t* down = row + stride;
      const __m256i beside = _mm256_max_epu8(load(row - 1), load(row + 1));
      const __m256i above = _mm256_max_epu8(_mm256_max_epu8(load(up - 1), load(up)), load(up + 1));
      const __m256i below =
          _mm256_max_epu8(_mm256_max_epu8(load(down - 1), load(down)), load(down + 1));
      const __m256i around = _mm256_max_epu8(beside, _mm256_max_epu8(above, below));
      const __m256i not_above = _mm256_cmpeq_epi8(_mm256_max_epu8(around, centre), around);
      unsigned bits = ~static_cast<unsigned>(_mm256_movemask_epi8(not_above));
      if (width - x < 32) bits &= (1U << (width - x)) - 1;
      for (; bits != 0; bits &= bits - 1) {
        const int column = x + __builtin_ctz(bits);
        out[n++] = {static_cast<std::uint16_t>(column), static_cast<std::uint16_t>(y),
                    scores[y * stride + column]};
      }
    }
  }
  return n;
}

void resize_row(const std::uint8_t* source, const ResizeColumns& columns, std::int16_t* out) {
  if (columns.block_begin == nullptr) {
    portable_kernels().resize_row(source, columns, out);
    return;
  }
  const int blocks = (columns.count + 7) / 8;
  for (int b = 0; b < blocks; ++b) {
    const __m128i pixels =
        _mm_loadu_si128(reinterpret_cast<const __m128i*>(source + columns.block_begin[b]));
    const __m128i shuffle =
        _mm_loadu_si128(reinterpret_cast<const __m128i*>(columns.block_shuffle + 16 * b));
    const __m256i pairs = _mm256_cvtepu8_epi16(_mm_shuffle_epi8(pixels, shuffle));
    const __m256i sums =
        _mm256_srli_epi32(_mm256_madd_epi16(pairs, load(columns.weights + 16 * b)), 4);
    _mm_storeu_si128(
        reinterpret_cast<__m128i*>(out + 8 * b),
        _mm_packs_epi32(_mm256_castsi256_si128(sums), _mm256_extracti128_si256(sums, 1)));
  }
}

/// 16 blended pixels as 16-bit numbers.
__m256i blend_16(const std::int16_t* upper, const std::int16_t* lower, __m256i upper_weight,
                 __m256i lower_weight) {
  const __m256i sum = _mm256_add_epi16(_mm256_mulhi_epi16(load(upper), upper_weight),
                                       _mm256_mulhi_epi16(load(lower), lower_weight));
  return _mm256_srli_epi16(_mm256_add_epi16(sum, _mm256_set1_epi16(2)), 2);
}

void resize_blend(const std::int16_t* upper, const std::int16_t* lower, int upper_weight,
                  int lower_weight, int count, std::uint8_t* out) {
  if (count < 32) {
    portable_kernels().resize_blend(upper, lower, upper_weight, lower_weight, count, out);
    return;
  }
  const __m256i a = _mm256_set1_epi16(static_cast<short>(upper_weight));
  const __m256i b = _mm256_set1_epi16(static_cast<short>(lower_weight));
  for (int i = 0; i < count; i += 32) {
    const int begin = i + 32 <= count ? i : count - 32;
    const __m256i packed =
        _mm256_packus_epi16(blend_16(upper + begin, lower + begin, a, b),
                            blend_16(upper + begin + 16, lower + begin + 16, a, b));
    store(out + begin, _mm256_permute4x64_epi64(packed, 0xD8));
  }
}

/// Sums over 7 neighbours for the even pixels of 32, modulo 65536, minus 32768.
__m256i blur_even(const std::uint8_t* p) {
  // Multiplies the neighbours of each even pixel by two taps at a time; 0x2212 is (18, 34) etc.
  const __m256i a = _mm256_maddubs_epi16(load(p), _mm256_set1_epi16(34 << 8 | 18));
  const __m256i b = _mm256_maddubs_epi16(load(p + 2), _mm256_set1_epi16(56 << 8 | 48));
  const __m256i c = _mm256_maddubs_epi16(load(p + 4), _mm256_set1_epi16(34 << 8 | 48));
  const __m256i d = _mm256_maddubs_epi16(load(p + 6), _mm256_set1_epi16(18));
  const __m256i sum = _mm256_add_epi16(_mm256_add_epi16(a, b), _mm256_add_epi16(c, d));
  return _mm256_xor_si256(sum, _mm256_set1_epi16(static_cast<short>(0x8000)));
}

/// Writes blocks of 16 even, then 16 odd pixels; sums are stored minus 32768 to be signed.
void blur_row(const std::uint8_t* padded, int count, std::uint16_t* out) {
  for (int i = 0; i < count; i += 32) {
    store(out + i, blur_even(padded + i));
    store(out + i + 16, blur_even(padded + i + 1));
  }
}

/// Weighted sum of 7 rows for 16 pixels, rounded to 16-bit numbers below 256.
__m256i blur_columns_16(const std::uint16_t* const rows[7], int i) {
  // The stored sums lack 32768, and the taps add up to 256: 256 * 32768 comes back with the
  // rounding constant.
  const __m256i constant = _mm256_set1_epi32((256 << 15) + (1 << 15));
  const __m256i taps[4] = {_mm256_set1_epi32(34 << 16 | 18), _mm256_set1_epi32(56 << 16 | 48),
                           _mm256_set1_epi32(34 << 16 | 48), _mm256_set1_epi32(18)};
  __m256i low = constant, high = constant;
  for (int k = 0; k < 4; ++k) {
    const __m256i first = load(rows[2 * k] + i);
    const __m256i second = k < 3 ? load(rows[2 * k + 1] + i) : _mm256_setzero_si256();
    low = _mm256_add_epi32(low, _mm256_madd_epi16(_mm256_unpacklo_epi16(first, second), taps[k]));
    high = _mm256_add_epi32(high, _mm256_madd_epi16(_mm256_unpackhi_epi16(first, second), taps[k]));
  }
  return _mm256_packus_epi32(_mm256_srli_epi32(low, 16), _mm256_srli_epi32(high, 16));
}

void blur_columns(const std::uint16_t* const rows[7], int count, std::uint8_t* out) {
  for (int i = 0; i < count; i += 32) {
    const __m256i even = blur_columns_16(rows, i);
    const __m256i odd = blur_columns_16(rows, i + 16);
    store(out + i, _mm256_or_si256(even, _mm256_slli_epi16(odd, 8)));
  }
}

/// Rows of the disc: its pixels as a mask, and their column numbers (0 outside).
struct DiscRows {
  alignas(32) std::uint8_t mask[disc_radius + 1][32];
  alignas(32) std::int8_t column[disc_radius + 1][32];
};

constexpr DiscRows make_disc_rows() {
  DiscRows rows{};
  for (int v = 0; v <= disc_radius; ++v) {
    for (int u = -disc_half_length[v]; u <= disc_half_length[v]; ++u) {
      rows.mask[v][u + disc_radius] = 0xFF;
      rows.column[v][u + disc_radius] = static_cast<std::int8_t>(u);
    }
  }
  return rows;
}

constexpr DiscRows disc_rows = make_disc_rows();

std::int32_t sum_of_lanes(__m256i value) {
  __m128i sum = _mm_add_epi32(_mm256_castsi256_si128(value), _mm256_extracti128_si256(value, 1));
  sum = _mm_add_epi32(sum, _mm_shuffle_epi32(sum, 0x4E));
  sum = _mm_add_epi32(sum, _mm_shuffle_epi32(sum, 0xB1));
  return _mm_cvtsi128_si32(sum);
}

void moments(const std::uint8_t* centre, std::ptrdiff_t stride, std::int32_t* m10,
             std::int32_t* m01) {
  const std::uint8_t* left = centre - disc_radius;
  const __m256i zero = _mm256_setzero_si256(), ones = _mm256_set1_epi16(1);
  __m256i sum_u =
      _mm256_madd_epi16(_mm256_maddubs_epi16(load(left), load(disc_rows.column[0])), ones);
  // sum over v of v d(v) = sum over k of the partial sums d(15) + ... + d(k).
  __m256i partial = zero, sum_v = zero;
  for (int v = disc_radius; v >= 1; --v) {
    const __m256i below = load(left + v * stride), above = load(left - v * stride);
    const __m256i column = load(disc_rows.column[v]), mask = load(disc_rows.mask[v]);
    // At most 4 * 255 * 15 in size: the sum of two rows fits 16 bits.
    const __m256i weighted =
        _mm256_add_epi16(_mm256_maddubs_epi16(below, column), _mm256_maddubs_epi16(above, column));
    sum_u = _mm256_add_epi32(sum_u, _mm256_madd_epi16(weighted, ones));
    const __m256i row_below = _mm256_sad_epu8(_mm256_and_si256(below, mask), zero);
    const __m256i row_above = _mm256_sad_epu8(_mm256_and_si256(above, mask), zero);
    partial = _mm256_add_epi32(partial, _mm256_sub_epi32(row_below, row_above));
    sum_v = _mm256_add_epi32(sum_v, partial);
  }
  *m10 = sum_of_lanes(sum_u);
  *m01 = sum_of_lanes(sum_v);
}

/// Offsets of 8 rotated points from the centre. No fused multiply-add: each product is rounded to
/// float32, descriptor bits depend on it.
__m256i rotated_offsets(const float* x, const float* y, __m256 cosine, __m256 sine,
                        __m256i stride) {
  const __m256 px = _mm256_load_ps(x), py = _mm256_load_ps(y);
  const __m256i column =
      _mm256_cvtps_epi32(_mm256_sub_ps(_mm256_mul_ps(px, cosine), _mm256_mul_ps(py, sine)));
  const __m256i row =
      _mm256_cvtps_epi32(_mm256_add_ps(_mm256_mul_ps(px, sine), _mm256_mul_ps(py, cosine)));
  return _mm256_add_epi32(_mm256_mullo_epi32(row, stride), column);
}

void brief(const std::uint8_t* centre, std::ptrdiff_t stride, float cosine, float sine,
           std::uint8_t* descriptor) {
  const OrbPatternColumns& pattern = orb_pattern_columns;
  const __m256 c = _mm256_set1_ps(cosine), s = _mm256_set1_ps(sine);
  const __m256i step = _mm256_set1_epi32(static_cast<int>(stride));
  alignas(32) std::int32_t first[256], second[256];
  for (int i = 0; i < 256; i += 8) {
    _mm256_store_si256(reinterpret_cast<__m256i*>(first + i),
                       rotated_offsets(pattern.x1 + i, pattern.y1 + i, c, s, step));
    _mm256_store_si256(reinterpret_cast<__m256i*>(second + i),
                       rotated_offsets(pattern.x2 + i, pattern.y2 + i, c, s, step));
  }
  for (int word = 0; word < 8; ++word) {
    std::uint32_t bits = 0;
    for (int i = 32 * word + 31; i >= 32 * word; --i) {
      bits += bits + (centre[first[i]] < centre[second[i]]);
    }
    __builtin_memcpy(descriptor + 4 * word, &bits, 4);
  }
}

constexpr Kernels kernels = {"avx2",   fast_scores,  local_maxima, resize_row, resize_blend,
                             blur_row, blur_columns, moments,      brief};

}  // namespace

const Kernels* avx2_kernels() { return &kernels; }

}  // namespace orbslam

#else

namespace orbslam {

const Kernels* avx2_kernels() { return nullptr; }

}  // namespace orbslam

#endif
