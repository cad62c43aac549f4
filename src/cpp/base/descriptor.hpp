// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>

namespace orbslam {

/// 256 bits of rotated BRIEF. Test i is bit i % 8 of byte i / 8 (bit 0 = least significant).
struct alignas(32) Descriptor {
  std::array<std::uint64_t, 4> words{};

  friend bool operator==(const Descriptor& a, const Descriptor& b) { return a.words == b.words; }
};
static_assert(sizeof(Descriptor) == 32);

/// Number of differing bits, 0..256. The baseline instruction set has popcnt.
inline int hamming_distance(const Descriptor& a, const Descriptor& b) {
  return __builtin_popcountll(a.words[0] ^ b.words[0]) +
         __builtin_popcountll(a.words[1] ^ b.words[1]) +
         __builtin_popcountll(a.words[2] ^ b.words[2]) +
         __builtin_popcountll(a.words[3] ^ b.words[3]);
}

}  // namespace orbslam
