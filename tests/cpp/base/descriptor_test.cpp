// SPDX-License-Identifier: BSD-3-Clause
#include "base/descriptor.hpp"

#include <gtest/gtest.h>

#include <cstring>

#include "support/npy.hpp"

namespace orbslam {
namespace {

Descriptor descriptor_at(const testing::Array<std::uint8_t>& rows, std::size_t i) {
  Descriptor descriptor;
  std::memcpy(descriptor.words.data(), &rows.at(i, 0), 32);
  return descriptor;
}

TEST(Descriptor, DistancesEqualTheReference) {
  const auto read = [](const char* name) {
    return testing::read_npy<std::uint8_t>(
        testing::test_data(std::string("golden/misc/") + name + ".npy"));
  };
  const auto a = read("descA"), b = read("descB");
  const auto expected =
      testing::read_npy<std::int32_t>(testing::test_data("golden/misc/out_hamming.npy"));
  ASSERT_GT(expected.rows(), 100U);
  for (std::size_t i = 0; i < expected.rows(); ++i) {
    EXPECT_EQ(hamming_distance(descriptor_at(a, i), descriptor_at(b, i)), expected.at(i));
  }
}

TEST(Descriptor, DistanceIsAMetric) {
  Descriptor zero, ones;
  ones.words.fill(~std::uint64_t{0});
  EXPECT_EQ(hamming_distance(zero, zero), 0);
  EXPECT_EQ(hamming_distance(zero, ones), 256);
  Descriptor one_bit;
  one_bit.words[2] = 1ULL << 63;
  EXPECT_EQ(hamming_distance(zero, one_bit), 1);
  EXPECT_EQ(hamming_distance(one_bit, ones), 255);
  EXPECT_FALSE(zero == one_bit);
}

}  // namespace
}  // namespace orbslam
