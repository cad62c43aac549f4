// SPDX-License-Identifier: BSD-3-Clause
#include "base/vector_unit.hpp"

#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "base/errors.hpp"
#include "base/vector_targets.hpp"
// Behind it.
#include <hwy/detect_targets.h>

namespace orbslam {
namespace {

// Asked of the compiler's library and not of Highway's, whose NEON wants ARM's instructions for
// encryption too: a Raspberry Pi 4 has none.
std::vector<VectorUnit> detect_vector_units() {
  std::vector<VectorUnit> units;
#if (HWY_TARGETS) & (HWY_EMU128)
  units.push_back(VectorUnit::plain);
#endif
#if (HWY_TARGETS) & (HWY_NEON)
  units.push_back(VectorUnit::neon);
#endif
#if (HWY_TARGETS) & (HWY_SSE4)
  units.push_back(VectorUnit::sse4);  // what the whole build is compiled for
#endif
#if (HWY_TARGETS) & (HWY_AVX2)
  if (__builtin_cpu_supports("avx2")) units.push_back(VectorUnit::avx2);
#endif
#if (HWY_TARGETS) & (HWY_AVX3)
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("avx512f") &&
      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512bw")) {
    units.push_back(VectorUnit::avx512);
  }
#endif
  return units;
}

}  // namespace

const char* name_of(VectorUnit unit) {
  switch (unit) {
    case VectorUnit::plain:
      return "plain";
    case VectorUnit::neon:
      return "neon";
    case VectorUnit::sse4:
      return "sse4";
    case VectorUnit::avx2:
      return "avx2";
    case VectorUnit::avx512:
      return "avx512";
  }
  return "";
}

const std::vector<VectorUnit>& vector_units() {
  static const std::vector<VectorUnit> units = detect_vector_units();
  return units;
}

bool portable_by_environment() {
  static const bool portable = [] {
    const char* value = std::getenv("ORBSLAM2PY_PORTABLE_KERNELS");
    return value != nullptr && *value != '\0' && std::strcmp(value, "0") != 0;
  }();
  return portable;
}

VectorUnit best_vector_unit() {
  return portable_by_environment() ? vector_units().front() : vector_units().back();
}

VectorUnit vector_unit(const std::string& name) {
  if (name == "automatic") return best_vector_unit();
  if (name == "portable") return vector_units().front();
  std::string known = "automatic, portable";
  for (const VectorUnit unit : vector_units()) {
    if (name == name_of(unit)) return unit;
    known += std::string(", ") + name_of(unit);
  }
  throw SettingsError("there are no kernels '" + name + "' for this processor; it has: " + known);
}

}  // namespace orbslam
