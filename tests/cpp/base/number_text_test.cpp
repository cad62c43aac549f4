// SPDX-License-Identifier: BSD-3-Clause
#include "base/number_text.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <string>

namespace orbslam {
namespace {

struct Reading {
  long length;
  double value;
};

template <typename Read>
Reading read(Read read, const std::string& text) {
  const std::string line = text + "\n";
  double value = 77;
  const char* end = read(line.data(), line.data() + text.size(), value);
  return {end - line.data(), value};
}

TEST(NumberText, BothWaysReadTheSame) {
  for (const char* text :
       {"1",    "-2.5", "0.1",  "1e-3", "1e400", "-1e400", "1e-400", "4.9e-324", "",
        "-",    "+1",   "--1",  "-+1",  " 1",    "-\t1",   "x",      "0x1p3",    "-0x2",
        "1.5x", "inf",  "-inf", ".5",   "5.",    "1e",     "1e+",    "1,5"}) {
    const Reading one = read(read_number, text);
    const Reading other = read(c_locale::read_number, text);
    EXPECT_EQ(one.length, other.length) << text;
    EXPECT_EQ(std::signbit(one.value), std::signbit(other.value)) << text;
    EXPECT_EQ(one.value, other.value) << text;
  }
}

TEST(NumberText, BothWaysWriteTheSameAndReadItBack) {
  std::mt19937_64 bits(1);
  for (int i = 0; i < 20000; ++i) {
    const std::uint64_t word = bits();
    double value = 0;
    std::memcpy(&value, &word, sizeof(value));
    if (!std::isfinite(value)) continue;
    char one[32], other[32];
    const std::string text(one, write_number(one, one + 32, value));
    ASSERT_EQ(text, std::string(other, c_locale::write_number(other, other + 32, value)));
    ASSERT_EQ(read(read_number, text).value, value);
    ASSERT_EQ(read(c_locale::read_number, text).value, value);
  }
}

}  // namespace
}  // namespace orbslam
