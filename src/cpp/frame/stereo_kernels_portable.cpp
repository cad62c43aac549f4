// SPDX-License-Identifier: BSD-3-Clause
#include "frame/stereo_kernels.hpp"

namespace orbslam::stereo {

void shifted_sad_portable(const WindowPair& windows, int* sums) {
  const int left_centre = windows.left[kHalfWindow][kHalfWindow];
  for (int k = 0; k < kShifts; ++k) {
    const int offset = left_centre - windows.right[kHalfWindow][k + kHalfWindow];
    int sum = 0;
    for (int row = 0; row < kWindow; ++row) {
      for (int column = 0; column < kWindow; ++column) {
        const int difference = windows.left[row][column] - windows.right[row][k + column] - offset;
        sum += difference < 0 ? -difference : difference;
      }
    }
    sums[k] = sum;
  }
}

ShiftedSad best_shifted_sad() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) return shifted_sad_avx2;
#endif
  return shifted_sad_portable;
}

}  // namespace orbslam::stereo
