// SPDX-License-Identifier: BSD-3-Clause
#include "frame/small_image.hpp"

#include <gtest/gtest.h>

#include <random>

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

TEST(SmallImage, IsWhatIsMeantOfAnyPartOfAnyImage) {
  std::mt19937_64 generator(3);
  cv::Mat1b whole(401, 913);
  for (std::uint8_t& pixel : whole) pixel = generator() & 255U;
  for (const cv::Rect part :
       {cv::Rect{0, 0, 913, 401}, {5, 3, 640, 377}, {1, 0, 99, 101}, {7, 9, 3, 390}}) {
    const cv::Mat1b image = whole(part);
    const SmallImage small = shrink_image(image);
    ASSERT_EQ(small.pixels.size(), static_cast<std::size_t>(small.width * small.height));
    for (int y = 0; y < small.height; ++y) {
      for (int x = 0; x < small.width; ++x) {
        double sum = 0;
        int n = 0;
        for (int row = y * small.shrink; row < (y + 1) * small.shrink; ++row) {
          if ((row - y * small.shrink) % 2 != 0) continue;
          for (int column = x * small.shrink; column < (x + 1) * small.shrink; ++column) {
            sum += image(row, column);
            n += 1;
          }
        }
        ASSERT_NEAR(small.pixels[static_cast<std::size_t>(y * small.width + x)], sum / n, 0.5001);
      }
    }
  }
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
