// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace orbslam {

/// Sets of vector instructions that kernels are compiled for. All give the same bytes.
enum class VectorUnit {
  plain,   ///< C++ without any: processors that are not listed here
  neon,    ///< 16 bytes: every 64-bit ARM
  sse4,    ///< 16 bytes: x86-64-v2
  avx2,    ///< 32 bytes: x86-64-v3
  avx512,  ///< 64 bytes: x86-64-v4
};

/// "plain", "neon", "sse4", "avx2" or "avx512".
const char* name_of(VectorUnit unit);

/// Those that kernels were compiled for and this processor has, slowest first; at least one.
const std::vector<VectorUnit>& vector_units();

/// True if the environment variable ORBSLAM2PY_PORTABLE_KERNELS is set to anything but 0. Read
/// once, so that the whole process uses one set of kernels.
bool portable_by_environment();

/// The last of `vector_units`, or the first if the environment asks for portable kernels.
VectorUnit best_vector_unit();

/// By its name, or "automatic" (the best), or "portable" (the one that every processor of this
/// kind has). Throws SettingsError for one that this processor or build does not have.
VectorUnit vector_unit(const std::string& name);

}  // namespace orbslam
