// SPDX-License-Identifier: BSD-3-Clause
#include "features/kernels.hpp"
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
  const bool portable = &choose_kernels(KernelChoice::automatic) == &orbslam::portable_kernels();
  return portable || avx2_kernels() == nullptr ? portable_kernels() : *avx2_kernels();
}

}  // namespace orbslam::bundle_kernels
