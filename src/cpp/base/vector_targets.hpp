// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// Which vector units Highway compiles kernels for; included before any of its headers. They are
// SSE4 (x86-64-v2), AVX2 (v3) and AVX-512 (v4), or NEON, or plain C++ on other processors. (Macros
// are how Highway is configured.)

// The kernels need none of these, so a processor does not need them either.
#define HWY_DISABLE_PCLMUL_AES
#define HWY_DISABLE_BMI2_FMA
#define HWY_DISABLE_F16C

// The vectors of SVE have no size while compiling, and cannot be elements of arrays; every
// processor that has them has NEON.
#define ORBSLAM2PY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#define HWY_DISABLED_TARGETS ORBSLAM2PY_DISABLED_TARGETS

// Plain C++ with vectors of 16 bytes, also by GCC before 12.3: the build keeps that compiler from
// the optimisation that it gets wrong there.
#define HWY_BROKEN_EMU128 0

// Asserts would need Highway's library; its headers are enough.
#define HWY_IS_DEBUG_BUILD 0
