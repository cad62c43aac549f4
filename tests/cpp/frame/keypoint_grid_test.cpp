// SPDX-License-Identifier: BSD-3-Clause
#include "frame/keypoint_grid.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <tuple>

#include "support/npy.hpp"

namespace orbslam {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using testing::read_npy;
using testing::test_data;
using Found = std::vector<std::uint32_t>;

constexpr ImageBounds kImage{0, 640, 0, 480};

Keypoint keypoint_at(float x, float y, int level = 0) {
  Keypoint keypoint;
  keypoint.x = x;
  keypoint.y = y;
  keypoint.level = level;
  return keypoint;
}

class Draws {
 public:
  explicit Draws(std::uint64_t seed) : generator_(seed) {}
  float real(float low, float high) {
    const double unit = static_cast<double>(generator_() >> 11U) * 0x1p-53;
    return low + static_cast<float>(unit) * (high - low);
  }
  int integer(int low, int high) {  // both ends included
    return low + static_cast<int>(generator_() % static_cast<std::uint64_t>(high - low + 1));
  }

 private:
  std::mt19937_64 generator_;
};

Found query(const KeypointGrid& grid, const std::vector<Keypoint>& keypoints, float x, float y,
            float r, int min_level = -1, int max_level = -1) {
  Found found = {12345};  // must be cleared
  grid.features_in_area(keypoints, x, y, r, min_level, max_level, found);
  return found;
}

TEST(KeypointGrid, CellsEqualTheGoldenOnes) {
  const auto bounds = read_npy<float>(test_data("golden/undist/out_bounds.npy")).values;
  const auto xy = read_npy<float>(test_data("golden/undist/out_kpun.npy"));
  const auto cells = read_npy<int>(test_data("golden/undist/out_cell.npy"));
  const KeypointGrid grid({}, {bounds[0], bounds[1], bounds[2], bounds[3]});
  for (std::size_t i = 0; i < xy.rows(); ++i) {
    const GridCell cell = grid.cell_of(xy.at(i, 0), xy.at(i, 1));
    EXPECT_EQ(cell.column, cells.at(i, 0)) << i;
    EXPECT_EQ(cell.row, cells.at(i, 1)) << i;
  }
}

TEST(KeypointGrid, PositionsGoToTheNearestGridLine) {
  const KeypointGrid grid({}, kImage);  // cells of 10 x 10 pixels
  EXPECT_EQ(grid.cell_of(4.9F, 0).column, 0);
  EXPECT_EQ(grid.cell_of(5.0F, 0).column, 1);
  EXPECT_EQ(grid.cell_of(0, 14.9F).row, 1);
  EXPECT_EQ(grid.cell_of(0, 15.0F).row, 2);
}

// OD-32: no keypoint within the bounds is without a cell.
TEST(KeypointGrid, TheLastHalfCellBelongsToTheLastCell) {
  const KeypointGrid grid({}, kImage);
  for (const float x : {634.9F, 635.0F, 639.0F, 640.0F}) EXPECT_EQ(grid.cell_of(x, 9).column, 63);
  for (const float y : {474.9F, 475.0F, 479.0F, 480.0F}) EXPECT_EQ(grid.cell_of(9, y).row, 47);
  EXPECT_EQ(grid.cell_of(640.1F, 9).column, -1);
  EXPECT_EQ(grid.cell_of(9, 480.1F).row, -1);
}

TEST(KeypointGrid, OutsideByMoreThanHalfACellIsInNoCell) {
  const KeypointGrid grid({}, kImage);
  EXPECT_EQ(grid.cell_of(-4.9F, 9).column, 0);
  EXPECT_EQ(grid.cell_of(-5.0F, 9).column, -1);
  EXPECT_EQ(grid.cell_of(-5.0F, 9).row, -1);
  EXPECT_EQ(grid.cell_of(9, -5.0F).row, -1);
  EXPECT_EQ(grid.cell_of(1e20F, 9).column, -1);
  EXPECT_EQ(grid.cell_of(NAN, 9).column, -1);
}

// OD-32: searches find what lies in the last half cell.
TEST(KeypointGrid, AKeypointInTheLastHalfCellIsFound) {
  const std::vector<Keypoint> keypoints = {keypoint_at(638, 478), keypoint_at(300, 200)};
  const KeypointGrid grid(keypoints, kImage);
  EXPECT_THAT(query(grid, keypoints, 639, 479, 2), ElementsAre(0));
  EXPECT_THAT(query(grid, keypoints, 650, 490, 13), ElementsAre(0));
}

TEST(KeypointGrid, TheSquareIsStrict) {
  const std::vector<Keypoint> keypoints = {keypoint_at(110, 100), keypoint_at(100, 90),
                                           keypoint_at(109.5F, 90.5F)};
  const KeypointGrid grid(keypoints, kImage);
  EXPECT_THAT(query(grid, keypoints, 100, 100, 10), ElementsAre(2));
}

TEST(KeypointGrid, LevelLimits) {
  std::vector<Keypoint> keypoints;
  for (int level = 0; level < 8; ++level) keypoints.push_back(keypoint_at(100, 100, level));
  const KeypointGrid grid(keypoints, kImage);
  EXPECT_THAT(query(grid, keypoints, 100, 100, 1, 2, 4), ElementsAre(2, 3, 4));
  EXPECT_THAT(query(grid, keypoints, 100, 100, 1, 6, -1), ElementsAre(6, 7));
  EXPECT_THAT(query(grid, keypoints, 100, 100, 1, -1, 0), ElementsAre(0));
  EXPECT_THAT(query(grid, keypoints, 100, 100, 1, 5, 4), IsEmpty());
  EXPECT_EQ(query(grid, keypoints, 100, 100, 1, -1, -1).size(), 8U);
  EXPECT_EQ(query(grid, keypoints, 100, 100, 1, 0, -1).size(), 8U);
}

TEST(KeypointGrid, ResultsFollowColumnsThenRowsThenIndices) {
  const std::vector<Keypoint> keypoints = {keypoint_at(121, 101), keypoint_at(101, 121),
                                           keypoint_at(101, 101), keypoint_at(121, 121),
                                           keypoint_at(99, 99),   keypoint_at(119, 119)};
  const KeypointGrid grid(keypoints, kImage);
  EXPECT_THAT(query(grid, keypoints, 110, 110, 30), ElementsAre(2, 4, 1, 0, 3, 5));
}

TEST(KeypointGrid, QueriesOutsideOrWithoutKeypointsAreEmpty) {
  const std::vector<Keypoint> keypoints = {keypoint_at(0, 0), keypoint_at(640, 480)};
  const KeypointGrid grid(keypoints, kImage);
  for (const auto& [x, y] : {std::pair(-50.0F, 10.0F),
                             {700.0F, 10.0F},
                             {10.0F, -50.0F},
                             {10.0F, 600.0F},
                             {1e30F, 0.0F},
                             {-1e30F, 0.0F},
                             {NAN, 0.0F}}) {
    EXPECT_THAT(query(grid, keypoints, x, y, 10), IsEmpty()) << x << " " << y;
  }
  EXPECT_EQ(query(grid, keypoints, 320, 240, 1e9F).size(), 2U);
  EXPECT_THAT(query(grid, keypoints, 0, 0, 0), IsEmpty());
  EXPECT_THAT(query(KeypointGrid({}, kImage), {}, 100, 100, 50), IsEmpty());
  EXPECT_THAT(query(KeypointGrid(), {}, 100, 100, 50), IsEmpty());
}

TEST(KeypointGrid, RandomQueriesEqualBruteForce) {
  Draws draws(17);
  const std::vector<ImageBounds> all_bounds = {{0, 640, 0, 480},
                                               {0, 1241, 0, 376},
                                               {10.8F, 626.05F, 14.67F, 473.31F},
                                               {-135.8F, 895.51F, -92.88F, 565.55F}};
  std::size_t total = 0;
  for (const ImageBounds& bounds : all_bounds) {
    std::vector<Keypoint> keypoints;
    for (int i = 0; i < 1500; ++i) {
      keypoints.push_back(keypoint_at(draws.real(bounds.min_x, bounds.max_x),
                                      draws.real(bounds.min_y, bounds.max_y), draws.integer(0, 7)));
    }
    const KeypointGrid grid(keypoints, bounds);
    const auto order = [&](std::uint32_t i) {
      const GridCell cell = grid.cell_of(keypoints[i].x, keypoints[i].y);
      return std::tuple(cell.column, cell.row, i);
    };
    for (int round = 0; round < 500; ++round) {
      const float x = draws.real(bounds.min_x - 100, bounds.max_x + 100);
      const float y = draws.real(bounds.min_y - 100, bounds.max_y + 100);
      const float r = draws.real(0, round % 10 == 0 ? 800.0F : 80.0F);
      const int min_level = draws.integer(-1, 7), max_level = draws.integer(-1, 7);
      Found expected;
      for (std::uint32_t i = 0; i < keypoints.size(); ++i) {
        const Keypoint& k = keypoints[i];
        const bool level_fits = k.level >= min_level && (max_level < 0 || k.level <= max_level);
        if (level_fits && std::abs(k.x - x) < r && std::abs(k.y - y) < r) expected.push_back(i);
      }
      std::sort(expected.begin(), expected.end(),
                [&](std::uint32_t a, std::uint32_t b) { return order(a) < order(b); });
      ASSERT_EQ(query(grid, keypoints, x, y, r, min_level, max_level), expected);
      total += expected.size();
    }
  }
  EXPECT_GT(total, 10000U);
}

}  // namespace
}  // namespace orbslam
