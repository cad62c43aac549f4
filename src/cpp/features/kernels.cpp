// SPDX-License-Identifier: BSD-3-Clause
#include "features/kernels.hpp"

#include <cstdlib>
#include <cstring>

#include "base/errors.hpp"

namespace orbslam {
namespace {

bool processor_has_avx2() {
#if defined(__x86_64__) || defined(__i386__)
  return __builtin_cpu_supports("avx2") != 0;
#else
  return false;
#endif
}

bool portable_by_environment() {
  // Read once, so that two extractors of one process never differ.
  static const bool portable = [] {
    const char* value = std::getenv("ORBSLAM2PY_PORTABLE_KERNELS");
    return value != nullptr && *value != '\0' && std::strcmp(value, "0") != 0;
  }();
  return portable;
}

}  // namespace

const Kernels& choose_kernels(KernelChoice choice) {
  const Kernels* avx2 = processor_has_avx2() ? avx2_kernels() : nullptr;
  switch (choice) {
    case KernelChoice::portable:
      return portable_kernels();
    case KernelChoice::avx2:
      if (avx2 == nullptr) {
        throw SettingsError(
            "this processor or build has no AVX2 kernels; use the automatic choice");
      }
      return *avx2;
    case KernelChoice::automatic:
      break;
  }
  return avx2 != nullptr && !portable_by_environment() ? *avx2 : portable_kernels();
}

}  // namespace orbslam
