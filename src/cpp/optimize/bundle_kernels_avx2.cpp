// SPDX-License-Identifier: BSD-3-Clause
// Compiled with -mavx2: see bundle_kernels.hpp for what may be included. Other kinds of processors
// have bundle_kernels_portable.cpp alone.
#if defined(__x86_64__)
#include "optimize/bundle_kernels.hpp"
#include "optimize/bundle_kernels_cholesky.hpp"
#include "optimize/bundle_kernels_points.hpp"

namespace orbslam::bundle_kernels {

const Kernels* avx2_kernels() {
  static constexpr Kernels kKernels{"avx2",          cost,      curvature, eliminate,
                                    back_substitute, factorise, solve};
  return &kKernels;
}

}  // namespace orbslam::bundle_kernels
#endif
