// SPDX-License-Identifier: BSD-3-Clause
#include "base/vector_unit.hpp"
#include "optimize/pose_sums.hpp"
#include "optimize/pose_sums_loops.hpp"

namespace orbslam::pose_sums {

const Kernels& portable_kernels() {
  static constexpr Kernels kKernels{"portable", dispatch<false>, dispatch<true>};
  return kKernels;
}

#if !defined(__x86_64__)
const Kernels* avx2_kernels() { return nullptr; }
#endif

const Kernels& best_kernels() {
  const VectorUnit unit = best_vector_unit();
  const bool has_avx2 = unit == VectorUnit::avx2 || unit == VectorUnit::avx512;
  return has_avx2 && avx2_kernels() != nullptr ? *avx2_kernels() : portable_kernels();
}

}  // namespace orbslam::pose_sums
