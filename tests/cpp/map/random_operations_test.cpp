// SPDX-License-Identifier: BSD-3-Clause
#include "random_operations.hpp"

#include <gtest/gtest.h>

#include "map/content_hash.hpp"

namespace orbslam::testing {
namespace {

class RandomMaps : public ::testing::TestWithParam<std::uint64_t> {};

TEST_P(RandomMaps, StayConsistentAfterEveryOperation) {
  RandomOperations operations(GetParam());
  for (int i = 0; i < 3000; ++i) {
    operations.perform();
    const auto violations = check_invariants(operations.map(), false);
    ASSERT_TRUE(violations.empty()) << "operation " << i << ": " << violations.front();
  }
  for (std::size_t operation = 0; operation < RandomOperations::kOperations; ++operation) {
    EXPECT_GT(operations.n_performed(operation), 50) << "operation " << operation << " is rare";
  }
  EXPECT_GT(operations.map().n_keyframes(), 5U);
  EXPECT_GT(operations.map().n_points(), 20U);
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomMaps, ::testing::Values(1, 2, 3, 4));

TEST(RandomMaps, EqualOperationsGiveEqualMaps) {
  RandomOperations a(11), b(11), c(12);
  for (int i = 0; i < 2000; ++i) {
    a.perform();
    b.perform();
    c.perform();
  }
  EXPECT_EQ(content_hash(a.map()), content_hash(b.map()));
  EXPECT_NE(content_hash(a.map()), content_hash(c.map()));
}

}  // namespace
}  // namespace orbslam::testing
