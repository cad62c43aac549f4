// SPDX-License-Identifier: BSD-3-Clause
#include "base/parallel.hpp"

#include <sched.h>

#include <cctype>
#include <cstdlib>
#include <limits>
#include <string_view>

namespace orbslam {
namespace {

constexpr std::size_t kNoLimit = std::numeric_limits<std::size_t>::max();

/// Cores that this process may use; a container or a job scheduler may limit them.
std::size_t n_cores() {
  cpu_set_t usable;
  if (sched_getaffinity(0, sizeof usable, &usable) == 0) {
    return static_cast<std::size_t>(CPU_COUNT(&usable));
  }
  return std::max(1U, std::thread::hardware_concurrency());  // more than such a set can hold
}

bool is_space(char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; }

/// The number in OMP_NUM_THREADS for the outermost level; kNoLimit if it is unset or invalid.
std::size_t wanted_threads() {
  const char* const variable = std::getenv("OMP_NUM_THREADS");
  if (variable == nullptr) return kNoLimit;
  std::string_view text(variable);
  text = text.substr(0, text.find(','));  // one per nested level
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  std::size_t number = 0;
  for (const char c : text) {
    if (c < '0' || c > '9') return kNoLimit;
    number = std::min<std::size_t>(10 * number + static_cast<std::size_t>(c - '0'), 1 << 20);
  }
  return number > 0 ? number : kNoLimit;
}

}  // namespace

std::size_t threads_for(std::size_t most) {
  return std::max<std::size_t>(1, std::min({most, wanted_threads(), n_cores()}));
}

}  // namespace orbslam
