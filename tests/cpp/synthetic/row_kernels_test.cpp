// SPDX-License-Identifier: BSD-3-Clause
#include "synthetic/row_kernels.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "synthetic/hash.hpp"
#include "synthetic/texture.hpp"

namespace orbslam::synthetic {
namespace {

Rectangle wall() {
  Rectangle rectangle;
  rectangle.origin = Eigen::Vector3d::Zero();
  rectangle.u_axis = Eigen::Vector3d::UnitX();
  rectangle.v_axis = Eigen::Vector3d::UnitY();
  rectangle.width = 3;
  rectangle.height = 2;
  rectangle.texture = 11;
  rectangle.texel = 0.01;
  return rectangle;
}

float log2_between_powers(float value) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof(bits));
  return static_cast<float>(bits) * 0x1p-23F - 127.0F;
}

float trilinear(const Texture& texture, float detail, float u, float v) {
  if (detail <= 0) return texture.sample(0, u, v);
  const int level = static_cast<int>(detail);
  const int last = texture.levels().count - 1;
  if (level >= last) return texture.sample(last, u, v);
  const float fine = texture.sample(level, u, v);
  return fine + (detail - static_cast<float>(level)) * (texture.sample(level + 1, u, v) - fine);
}

/// What kinds of footprints a run had, so that a test can tell that it saw all of them.
struct Seen {
  int sharp = 0, one_tap = 0, narrow = 0, between = 0, coarsest = 0;
};

/// The mean over the footprint by its definition, in plain C++.
float filtered(const Texture& texture, float u, float v, float ux, float vx, float uy, float vy,
               Seen& seen) {
  const float length_x = std::sqrt(ux * ux + vx * vx);
  const float length_y = std::sqrt(uy * uy + vy * vy);
  const float longer = std::max(length_x, length_y);
  if (longer <= 1) {
    ++seen.sharp;
    return texture.sample(0, u, v);
  }
  const float shorter = std::abs(ux * vy - uy * vx) / longer;
  const bool narrow = longer >= kMostTaps * shorter;
  const int taps =
      narrow ? kMostTaps : std::max(1, static_cast<int>(std::floor(longer / shorter + 0.5F)));
  ++(taps == 1 ? seen.one_tap : narrow ? seen.narrow : seen.between);
  const auto count = static_cast<float>(taps);
  const float detail = log2_between_powers(std::max(shorter, longer / count));
  seen.coarsest += static_cast<int>(static_cast<int>(detail) >= texture.levels().count - 1);
  const float du = (length_x > length_y ? ux : uy) / count;
  const float dv = (length_x > length_y ? vx : vy) / count;
  float sum = 0;
  for (int i = 0; i < taps; ++i) {
    const float offset = static_cast<float>(i) - 0.5F * (count - 1);
    sum += trilinear(texture, detail, u + offset * du, v + offset * dv);
  }
  return sum / count;
}

struct Pixel {
  float grey, depth;
};

Pixel shaded(const Texture& texture, const TexturedRow& row, int x, Seen& seen) {
  const double z = 1 / row.inverse_depth(x);
  const double u = row.a(x) * z;
  const double v = row.b(x) * z;
  const double scale = z * row.texels_per_metre;
  const auto slope = [scale](double value, double of_value, double of_depth) {
    return static_cast<float>((of_value - value * of_depth) * scale);
  };
  const double w = row.inverse_depth.slope;
  return {filtered(texture, static_cast<float>(u * row.texels_per_metre),
                   static_cast<float>(v * row.texels_per_metre), slope(u, row.a.slope, w),
                   slope(v, row.b.slope, w), slope(u, row.a_down, row.inverse_depth_down),
                   slope(v, row.b_down, row.inverse_depth_down), seen),
          static_cast<float>(z)};
}

TEST(RowKernels, EachUnitShadesByTheDefinition) {
  const Texture texture(wall());
  for (const VectorUnit unit : vector_units()) {
    SCOPED_TRACE(name_of(unit));
    std::mt19937_64 generator(3);
    std::uniform_real_distribution<double> uniform(-1, 1);
    Seen seen;
    for (int round = 0; round < 3000; ++round) {
      // From a wall that fills the view at arm's length to one of a few pixels.
      const double near = std::exp(3.5 * uniform(generator) - 1);
      const auto slant = [&] { return 0.02 * near * std::pow(uniform(generator), 3); };
      const double along = 0.02 * std::exp2(2 * uniform(generator));
      TexturedRow row{};
      row.inverse_depth = {near, slant() / 10};
      row.a = {1.5 * near + uniform(generator), along};
      row.b = {near + uniform(generator), slant()};
      row.inverse_depth_down = slant() / 10;
      row.a_down = slant();
      row.b_down = round % 3 == 0 ? 0.1 * along : along;
      row.texels_per_metre = 100;
      row.levels = &texture.levels();
      const int begin = round % 40;
      const int end = begin + 1 + static_cast<int>(generator() % 40);
      if (row.inverse_depth(end) < 1e-3) continue;
      std::vector<float> grey(static_cast<std::size_t>(end + kRowPadding), -1);
      std::vector<float> depth = grey;
      row_kernels_for(unit).shade(row, begin, end, grey.data(), depth.data());
      for (int x = 0; x < end; ++x) {
        const auto at = static_cast<std::size_t>(x);
        const Pixel right = x < begin ? Pixel{-1, -1} : shaded(texture, row, x, seen);
        ASSERT_EQ(grey[at], right.grey) << "round " << round << ", pixel " << x;
        ASSERT_EQ(depth[at], right.depth) << "round " << round << ", pixel " << x;
      }
    }
    for (const int count : {seen.sharp, seen.one_tap, seen.narrow, seen.between, seen.coarsest}) {
      EXPECT_GT(count, 500);
    }
  }
}

TEST(RowKernels, EachUnitClaimsWhatIsNearer) {
  for (const VectorUnit unit : vector_units()) {
    SCOPED_TRACE(name_of(unit));
    std::mt19937_64 generator(4);
    std::uniform_real_distribution<double> uniform(-1, 1);
    std::vector<double> nearest(100, 0.0);
    std::vector<std::int64_t> owners(100, -1);
    std::vector<double> right = nearest;
    std::vector<std::int64_t> right_owners = owners;
    for (std::int64_t owner = 0; owner < 200; ++owner) {
      const Line line{uniform(generator), 0.02 * uniform(generator)};
      const int first = static_cast<int>(generator() % 100);
      const int last = std::min(99, first + static_cast<int>(generator() % 40));
      row_kernels_for(unit).claim(line, first, last, owner, nearest.data(), owners.data());
      for (int x = first; x <= last; ++x) {
        const auto at = static_cast<std::size_t>(x);
        if (line(x) > right[at]) {
          right[at] = line(x);
          right_owners[at] = owner;
        }
      }
      ASSERT_EQ(nearest, right) << owner;
      ASSERT_EQ(owners, right_owners) << owner;
    }
  }
}

/// Normal noise of one pixel: the sum of four uniform 16-bit numbers.
float unit_noise(std::uint64_t seed, std::uint32_t x, std::uint32_t y) {
  const std::uint64_t pixel = (static_cast<std::uint64_t>(y) << 32U) | x;
  const std::uint64_t bits = mix(seed + pixel * 0x9e3779b97f4a7c15ULL);
  const std::uint64_t sum =
      (bits & 0xffff) + ((bits >> 16) & 0xffff) + ((bits >> 32) & 0xffff) + (bits >> 48);
  return (static_cast<float>(sum) - 2 * 65535.0F) / 37837.2F;
}

TEST(RowKernels, EachUnitExposesByTheDefinition) {
  std::mt19937_64 generator(5);
  for (const VectorUnit unit : vector_units()) {
    SCOPED_TRACE(name_of(unit));
    for (int width = 1; width < 70; ++width) {
      std::vector<float> grey(static_cast<std::size_t>(width + kRowPadding));
      for (float& value : grey) value = static_cast<float>(generator() >> 40) * 0x1p-16F;
      const std::uint64_t seed = generator();
      const auto y = static_cast<std::uint32_t>(generator() % 2000);
      for (const float noise : {0.0F, 1.5F, 40.0F}) {
        std::vector<std::uint8_t> out(grey.size());
        row_kernels_for(unit).expose(grey.data(), width, 1.1F, noise, seed, y, out.data());
        for (int x = 0; x < width; ++x) {
          const auto at = static_cast<std::size_t>(x);
          float value = grey[at] * 1.1F;
          if (noise > 0) value += noise * unit_noise(seed, static_cast<std::uint32_t>(x), y);
          value = std::min(std::max(value, 0.0F), 255.0F);
          ASSERT_EQ(out[at], static_cast<std::uint8_t>(std::floor(value + 0.5F))) << "pixel " << x;
        }
      }
    }
  }
}

}  // namespace
}  // namespace orbslam::synthetic
