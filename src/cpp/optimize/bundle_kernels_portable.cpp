// SPDX-License-Identifier: BSD-3-Clause
#include "base/vector_unit.hpp"
#include "optimize/bundle_kernels.hpp"
#include "optimize/bundle_kernels_cholesky.hpp"
#include "optimize/bundle_kernels_points.hpp"

namespace orbslam::bundle_kernels {

const Kernels& portable_kernels() {
  static const Kernels kernels{"portable",      cost,      curvature, eliminate,
                               back_substitute, factorise, solve};
  return kernels;
}

#if !defined(__x86_64__)
const Kernels* avx2_kernels() { return nullptr; }
#endif

const Kernels& best_kernels() {
  const VectorUnit unit = best_vector_unit();
  const bool has_avx2 = unit == VectorUnit::avx2 || unit == VectorUnit::avx512;
  return has_avx2 && avx2_kernels() != nullptr ? *avx2_kernels() : portable_kernels();
}

}  // namespace orbslam::bundle_kernels
