// SPDX-License-Identifier: BSD-3-Clause
#include "frame/small_image.hpp"

#include <gtest/gtest.h>

#include "base/errors.hpp"

namespace orbslam {
namespace {

TEST(SmallImage, HasSome1500PixelsOfAnyImage) {
  for (const auto& [width, height] : {std::pair{640, 480}, {1241, 376}, {320, 240}, {480, 640}}) {
    const SmallImage small = shrink_image(cv::Mat1b(height, width, std::uint8_t{7}));
    const auto n = static_cast<std::size_t>(small.width * small.height);
    EXPECT_EQ(small.pixels.size(), n);
    EXPECT_GT(n, 1300U);
    EXPECT_LT(n, 1700U);
    EXPECT_LE(small.width * small.shrink, width);
    EXPECT_LE(small.height * small.shrink, height);
  }
}

TEST(SmallImage, PixelsAreMeansOfSquares) {
  cv::Mat1b image(480, 640, std::uint8_t{0});
  const SmallImage empty = shrink_image(image);
  const int side = empty.shrink;
  image(cv::Rect(3 * side, 2 * side, side, side)).setTo(200);
  image(cv::Rect(5 * side, 2 * side, side / 2, side)).setTo(200);
  const SmallImage small = shrink_image(image);
  const auto at = [&](int x, int y) { return int{small.pixels[std::size_t(y * small.width + x)]}; };
  EXPECT_EQ(at(3, 2), 200);
  EXPECT_EQ(at(4, 2), 0);
  EXPECT_EQ(at(3, 3), 0);
  EXPECT_NEAR(at(5, 2), 200.0 * (side / 2) / side, 1);
}

TEST(SmallImage, OfTheSmallestImages) {
  const SmallImage small = shrink_image(cv::Mat1b(5, 3, std::uint8_t{9}));
  EXPECT_EQ(small.width, 3);
  EXPECT_EQ(small.height, 5);
  const SmallImage strip = shrink_image(cv::Mat1b(2, 40000, std::uint8_t{9}));
  EXPECT_EQ(strip.height, 1);
}

TEST(SmallImage, RefusesColours) {
  EXPECT_THROW(shrink_image(cv::Mat3b(48, 64)), ImageError);
  EXPECT_THROW(shrink_image(cv::Mat()), ImageError);
}

}  // namespace
}  // namespace orbslam
