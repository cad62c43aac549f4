// SPDX-License-Identifier: BSD-3-Clause
#include "base/vector_unit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "base/errors.hpp"

namespace orbslam {
namespace {

TEST(VectorUnits, AreListedOnceSlowestFirst) {
  const auto& units = vector_units();
  ASSERT_FALSE(units.empty());
  EXPECT_TRUE(std::is_sorted(units.begin(), units.end()));
  EXPECT_EQ(std::set<VectorUnit>(units.begin(), units.end()).size(), units.size());
}

TEST(VectorUnits, AreThoseOfTheProcessor) {
#if defined(ORBSLAM2PY_PLAIN_KERNELS)
  EXPECT_THAT(vector_units(), ::testing::ElementsAre(VectorUnit::plain));
#elif defined(__x86_64__)
  EXPECT_EQ(vector_units().front(), VectorUnit::sse4);
  EXPECT_EQ(std::count(vector_units().begin(), vector_units().end(), VectorUnit::avx2),
            __builtin_cpu_supports("avx2") != 0 ? 1 : 0);
#elif defined(__aarch64__)
  EXPECT_THAT(vector_units(), ::testing::ElementsAre(VectorUnit::neon));
#else
  EXPECT_THAT(vector_units(), ::testing::ElementsAre(VectorUnit::plain));
#endif
}

TEST(VectorUnits, AreFoundByName) {
  for (const VectorUnit unit : vector_units()) EXPECT_EQ(vector_unit(name_of(unit)), unit);
  EXPECT_EQ(vector_unit("portable"), vector_units().front());
  EXPECT_EQ(vector_unit("automatic"), best_vector_unit());
  EXPECT_EQ(best_vector_unit(),
            portable_by_environment() ? vector_units().front() : vector_units().back());
}

TEST(VectorUnits, OthersAreRefusedWithTheNamesThatThereAre) {
  try {
    vector_unit("altivec");
    FAIL();
  } catch (const SettingsError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("altivec"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("portable"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr(name_of(vector_units().front())));
  }
}

}  // namespace
}  // namespace orbslam
