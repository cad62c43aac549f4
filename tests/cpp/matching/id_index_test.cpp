// SPDX-License-Identifier: BSD-3-Clause
#include "matching/id_index.hpp"

#include <gtest/gtest.h>

#include <map>
#include <random>

#include "matching/by_projection.hpp"

namespace orbslam {
namespace {

TEST(PointIdIndex, AnEmptyTableFindsNothing) {
  const PointIdIndex index;
  EXPECT_EQ(index.find(MapPointId(0)), PointIdIndex::kNone);
  EXPECT_EQ(index.find(MapPointId()), PointIdIndex::kNone);
}

TEST(PointIdIndex, TheFirstNumberStays) {
  PointIdIndex index;
  EXPECT_TRUE(index.insert(MapPointId(5), 1));
  EXPECT_FALSE(index.insert(MapPointId(5), 2));
  EXPECT_EQ(index.find(MapPointId(5)), 1);
  index.reset(0);
  EXPECT_EQ(index.find(MapPointId(5)), PointIdIndex::kNone);
}

// Growing from the smallest size, with close, distant and temporary ids.
TEST(PointIdIndex, EqualsAMapForRandomIds) {
  std::mt19937_64 random(3);
  PointIdIndex index;
  for (int round = 0; round < 5; ++round) {
    std::map<std::int64_t, std::int32_t> expected;
    index.reset(round == 4 ? 5000 : 0);
    for (std::int32_t i = 0; i < 5000; ++i) {
      std::int64_t id = static_cast<std::int64_t>(random() % 20000);
      if (i % 3 == 1) id <<= 32;
      if (i % 50 == 2) id += kFirstTemporaryPoint.value;
      EXPECT_EQ(index.insert(MapPointId(id), i), expected.emplace(id, i).second);
    }
    for (const auto& [id, number] : expected) EXPECT_EQ(index.find(MapPointId(id)), number);
    for (std::int64_t id = 20000; id < 21000; ++id) {
      EXPECT_EQ(index.find(MapPointId(id)), PointIdIndex::kNone);
    }
  }
}

}  // namespace
}  // namespace orbslam
