// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/texture.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace orbslam::synthetic {
namespace {

Rectangle wall(double width, double height) {
  Rectangle rectangle;
  rectangle.origin = Eigen::Vector3d::Zero();
  rectangle.u_axis = Eigen::Vector3d::UnitX();
  rectangle.v_axis = Eigen::Vector3d::UnitY();
  rectangle.width = width;
  rectangle.height = height;
  rectangle.texture = 11;
  rectangle.texel = 0.01;
  return rectangle;
}

/// Value at the centre of texel (x, y).
float texel(const Texture& texture, int x, int y) {
  return texture.sample(0, static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F);
}

TEST(Texture, PiecesOfACutWallFitTogether) {
  const Texture whole(wall(6, 2));
  Rectangle right_part = wall(2.5, 1.2);
  right_part.texture_offset = 3;
  right_part.texture_offset_v = 0.5;
  const Texture piece(right_part);
  // Away from its border, where the filter lacks neighbours.
  for (int y = 2; y < 118; ++y) {
    for (int x = 2; x < 248; ++x) ASSERT_EQ(texel(piece, x, y), texel(whole, x + 300, y + 50));
  }
}

TEST(Texture, RepeatsAfterTheGivenLength) {
  Rectangle repeating = wall(12, 2);
  repeating.texture_repeat = 4;
  const Texture texture(repeating);
  const Texture endless(wall(12, 2));
  int different = 0;
  for (int y = 2; y < 198; ++y) {
    for (int x = 2; x < 798; ++x) {
      ASSERT_EQ(texel(texture, x, y), texel(texture, x + 400, y));
      different +=
          static_cast<int>(std::abs(texel(endless, x, y) - texel(endless, x + 400, y)) > 10);
    }
  }
  EXPECT_GT(different, 50000);  // a third of the texels
}

TEST(Texture, CoarseLevelsAreMeansOfFineOnes) {
  const Texture texture(wall(2.56, 2.56));
  double mean = 0;
  for (int y = 0; y < 256; ++y) {
    for (int x = 0; x < 256; ++x) mean += texel(texture, x, y);
  }
  EXPECT_NEAR(texture.sample(texture.levels().count - 1, 128, 128), mean / 65536, 3);
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) {
      double block = 0;
      for (int i = 0; i < 256; ++i) block += texel(texture, 16 * x + i % 16, 16 * y + i / 16);
      ASSERT_NEAR(texture.sample(4, 16 * static_cast<float>(x) + 8, 16 * static_cast<float>(y) + 8),
                  block / 256, 2);
    }
  }
}

TEST(Texture, UsesMostOfTheGreyRange) {
  const Texture texture(wall(4, 4));
  double sum = 0;
  double square = 0;
  for (int y = 0; y < 400; ++y) {
    for (int x = 0; x < 400; ++x) {
      const double value = texel(texture, x, y);
      sum += value;
      square += value * value;
    }
  }
  const double mean = sum / 160000;
  EXPECT_NEAR(mean, 128, 50);
  EXPECT_GT(std::sqrt(square / 160000 - mean * mean), 20);
}

}  // namespace
}  // namespace orbslam::synthetic
