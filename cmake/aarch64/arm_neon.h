// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Found before the compiler's header of this name, which it includes. Eigen takes fused multiply-add from it,
// with one rounding where x86-64-v2 has two: without, and with blocks of the same size, its results on ARM are
// those on x86-64 to the last bit (tests/cpp/base/eigen_results_test.cpp).
#include_next <arm_neon.h>

// Products of small matrices ask for it by the macro.
#undef __ARM_FEATURE_FMA

// Products of large ones have their own kernel, which does not ask.
#undef vfmaq_n_f32
#undef vfmaq_n_f64
#undef vfmaq_laneq_f32
#undef vfmaq_laneq_f64
#define vfmaq_n_f32(sum, a, b) vaddq_f32(sum, vmulq_n_f32(a, b))
#define vfmaq_n_f64(sum, a, b) vaddq_f64(sum, vmulq_n_f64(a, b))
#define vfmaq_laneq_f32(sum, a, b, lane) vaddq_f32(sum, vmulq_laneq_f32(a, b, lane))
#define vfmaq_laneq_f64(sum, a, b, lane) vaddq_f64(sum, vmulq_laneq_f64(a, b, lane))

// Included by Eigen between what sets the size of that kernel's blocks and the kernel.
#define EIGEN_DENSEBASE_PLUGIN <eigen_block_size.hpp>
