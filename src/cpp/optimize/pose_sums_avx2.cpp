// SPDX-License-Identifier: BSD-3-Clause
// Compiled with -mavx2: see bundle_kernels.hpp for what may be included. Other kinds of processors
// have pose_sums_portable.cpp alone.
#if defined(__x86_64__)
#include "optimize/pose_sums.hpp"
#include "optimize/pose_sums_loops.hpp"

namespace orbslam::pose_sums {

const Kernels* avx2_kernels() {
  static constexpr Kernels kKernels{"avx2", dispatch<false>, dispatch<true>};
  return &kKernels;
}

}  // namespace orbslam::pose_sums
#endif
