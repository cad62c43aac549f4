// SPDX-License-Identifier: BSD-3-Clause
#include "frame/stereo_kernels.hpp"

#if defined(__AVX2__)

#include <immintrin.h>

namespace orbslam::stereo {

void shifted_sad_avx2(const WindowPair& windows, int* sums) {
  __m256i left[kWindow];
  for (int row = 0; row < kWindow; ++row) {
    left[row] =
        _mm256_cvtepu8_epi16(_mm_load_si128(reinterpret_cast<const __m128i*>(windows.left[row])));
  }
  // One in the 11 columns of the window, zero in the padding: the multiply-add at the end sums
  // neighbours to 32 bits and drops the padding in one instruction. The 16-bit columns cannot
  // overflow: 11 rows of at most 510.
  const __m256i window_columns = _mm256_setr_epi16(1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0);
  const int left_centre = windows.left[kHalfWindow][kHalfWindow];

  for (int k = 0; k < kShifts; ++k) {
    const int offset = left_centre - windows.right[kHalfWindow][k + kHalfWindow];
    const __m256i offsets = _mm256_set1_epi16(static_cast<short>(offset));
    __m256i columns = _mm256_setzero_si256();
    for (int row = 0; row < kWindow; ++row) {
      const __m256i right = _mm256_cvtepu8_epi16(
          _mm_loadu_si128(reinterpret_cast<const __m128i*>(windows.right[row] + k)));
      const __m256i difference = _mm256_sub_epi16(_mm256_sub_epi16(left[row], right), offsets);
      columns = _mm256_add_epi16(columns, _mm256_abs_epi16(difference));
    }
    const __m256i pairs = _mm256_madd_epi16(columns, window_columns);
    __m128i sum = _mm_add_epi32(_mm256_castsi256_si128(pairs), _mm256_extracti128_si256(pairs, 1));
    sum = _mm_add_epi32(sum, _mm_shuffle_epi32(sum, 0x4E));
    sum = _mm_add_epi32(sum, _mm_shuffle_epi32(sum, 0xB1));
    sums[k] = _mm_cvtsi128_si32(sum);
  }
}

}  // namespace orbslam::stereo

#endif
