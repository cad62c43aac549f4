// SPDX-License-Identifier: BSD-3-Clause
#include "features/kernels.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "features/gaussian_blur.hpp"
#include "features/images.hpp"
#include "features/orb_extractor.hpp"
#include "features/orb_pattern.hpp"
#include "features/orientation.hpp"
#include "features/pyramid_builder.hpp"

namespace orbslam {
namespace {

using testing::random_image;

TEST(Kernels, EachUnitGivesTheSameFeatures) {
  const cv::Size sizes[] = {{640, 480}, {333, 257}, {101, 99},  {62, 62},  {63, 131},
                            {67, 65},   {250, 777}, {777, 250}, {95, 400}, {1241, 376}};
  std::uint64_t seed = 0;
  for (const cv::Size& size : sizes) {
    OrbOptions options;
    options.n_features = 700;
    options.scale_factor = 1.1F + 0.1F * static_cast<float>(seed % 8);
    for (int repeat = 0; repeat < 3; ++repeat, ++seed) {
      const cv::Mat image = random_image(size.width, size.height, seed);
      OrbExtractor slowest(options, vector_units().front());
      ASSERT_EQ(slowest.vector_unit(), vector_units().front());
      const Extraction first = slowest.extract(image);
      EXPECT_GT(first.features.size(), 0U);
      for (const VectorUnit unit : vector_units()) {
        if (unit == slowest.vector_unit()) continue;
        SCOPED_TRACE(name_of(unit));
        OrbExtractor extractor(options, unit);
        ASSERT_EQ(extractor.vector_unit(), unit);
        const Extraction other = extractor.extract(image);
        EXPECT_TRUE(testing::same_features(first.features, other.features))
            << size << " seed " << seed;
        for (std::size_t level = 0; level < first.pyramid.levels.size(); ++level) {
          EXPECT_TRUE(
              testing::same_pixels(first.pyramid.levels[level], other.pyramid.levels[level]));
        }
      }
    }
  }
}

TEST(Kernels, PyramidEqualsOpenCvResize) {
  const cv::Size sizes[] = {{640, 480}, {333, 257}, {39, 21}, {17, 5}, {16, 16}, {128, 64}, {1, 9}};
  for (const VectorUnit unit : vector_units()) {
    SCOPED_TRACE(name_of(unit));
    const Kernels& kernels = kernels_for(unit);
    for (const cv::Size& size : sizes) {
      for (const float factor : {1.01F, 1.2F, 1.37F, 1.5F, 1.93F, 2.0F}) {
        const cv::Mat image =
            random_image(size.width, size.height, static_cast<std::uint64_t>(size.area()));
        const ScalePyramid scales(factor, 5);
        const auto levels = PyramidBuilder().build(image, scales, kernels).levels;
        ASSERT_EQ(levels.size(), 5U);
        for (int level = 1; level < 5; ++level) {
          const auto at = static_cast<std::size_t>(level);
          const ImageSize expected = scales.level_size({size.width, size.height}, level);
          if (levels[at].empty()) {
            EXPECT_EQ(expected.width * expected.height, 0);
            break;
          }
          ASSERT_EQ(levels[at].cols, expected.width);
          ASSERT_EQ(levels[at].rows, expected.height);
          cv::Mat resized;
          cv::resize(levels[at - 1], resized, levels[at].size(), 0, 0, cv::INTER_LINEAR);
          EXPECT_TRUE(testing::same_pixels(levels[at], resized))
              << size << " factor " << factor << " level " << level;
        }
      }
    }
  }
}

TEST(Kernels, BlurEqualsOpenCvGaussian) {
  for (const VectorUnit unit : vector_units()) {
    SCOPED_TRACE(name_of(unit));
    const Kernels& kernels = kernels_for(unit);
    GaussianBlur gaussian;
    for (const cv::Size& size : {cv::Size(640, 480), cv::Size(33, 31), cv::Size(65, 7),
                                 cv::Size(7, 65), cv::Size(4, 4), cv::Size(301, 200)}) {
      const cv::Mat image = random_image(size.width, size.height, 3);
      cv::Mat expected;
      cv::GaussianBlur(image, expected, cv::Size(7, 7), 2, 2, cv::BORDER_REFLECT_101);
      EXPECT_TRUE(testing::same_pixels(gaussian.blur(image, kernels), expected)) << size;
    }
    const cv::Mat white(40, 50, CV_8UC1, cv::Scalar(255));
    EXPECT_TRUE(testing::same_pixels(gaussian.blur(white, kernels), white));
  }
}

/// Definition: 9 neighbours in a row all brighter or all darker by more than the threshold.
bool is_corner(const cv::Mat& image, int x, int y, int threshold) {
  static const int ring[16][2] = {{0, 3},  {1, 3},  {2, 2},  {3, 1},   {3, 0},   {3, -1},
                                  {2, -2}, {1, -3}, {0, -3}, {-1, -3}, {-2, -2}, {-3, -1},
                                  {-3, 0}, {-3, 1}, {-2, 2}, {-1, 3}};
  for (int start = 0; start < 16; ++start) {
    bool bright = true, dark = true;
    for (int k = 0; k < 9; ++k) {
      const int* offset = ring[(start + k) % 16];
      const int difference =
          image.at<std::uint8_t>(y + offset[1], x + offset[0]) - image.at<std::uint8_t>(y, x);
      bright = bright && difference > threshold;
      dark = dark && difference < -threshold;
    }
    if (bright || dark) return true;
  }
  return false;
}

TEST(Kernels, FastScoreIsTheLargestThreshold) {
  for (const VectorUnit unit : vector_units()) {
    SCOPED_TRACE(name_of(unit));
    const Kernels& kernels = kernels_for(unit);
    for (const int width : {7, 17, 22, 38, 39, 69, 71, 135}) {
      const cv::Mat image = random_image(width, 40, static_cast<std::uint64_t>(width));
      const int count = image.cols - 6;
      std::vector<std::uint8_t> scores(static_cast<std::size_t>(count));
      for (int y = 3; y < image.rows - 3; ++y) {
        kernels.fast_scores(image.ptr(y) + 3, static_cast<std::ptrdiff_t>(image.step[0]), count, 7,
                            scores.data());
        for (int x = 3; x < image.cols - 3; ++x) {
          const int score = scores[static_cast<std::size_t>(x - 3)];
          if (score == 0) {
            EXPECT_FALSE(is_corner(image, x, y, 7));
          } else {
            EXPECT_GE(score, 7);
            EXPECT_TRUE(is_corner(image, x, y, score));
            EXPECT_FALSE(is_corner(image, x, y, score + 1));
          }
        }
      }
    }
  }
}

TEST(Kernels, MomentsOfTheDisc) {
  for (const VectorUnit unit : vector_units()) {
    SCOPED_TRACE(name_of(unit));
    const Kernels& kernels = kernels_for(unit);
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      const cv::Mat image =
          seed == 0 ? cv::Mat(41, 41, CV_8UC1, cv::Scalar(255)) : random_image(41, 41, seed);
      int m10 = 0, m01 = 0, pixels = 0;
      for (int v = -15; v <= 15; ++v) {
        for (int u = -15; u <= 15; ++u) {
          // The disc is symmetric about the diagonals, so both half lengths decide alike.
          if (std::abs(u) > disc_half_length[std::abs(v)]) continue;
          EXPECT_LE(std::abs(v), disc_half_length[std::abs(u)]);
          m10 += u * image.at<std::uint8_t>(20 + v, 20 + u);
          m01 += v * image.at<std::uint8_t>(20 + v, 20 + u);
          ++pixels;
        }
      }
      EXPECT_EQ(pixels, 749);
      std::int32_t found10 = 1, found01 = 1;
      kernels.moments(image.ptr(20) + 20, static_cast<std::ptrdiff_t>(image.step[0]), &found10,
                      &found01);
      EXPECT_EQ(found10, m10);
      EXPECT_EQ(found01, m01);
    }
  }
}

/// Nearest integers, half to even, of coordinates whose products are rounded to float32 first.
int rotated_pixel(const cv::Mat& image, float x, float y, float cosine, float sine) {
  const volatile float xc = x * cosine, ys = y * sine, xs = x * sine, yc = y * cosine;
  const int column = static_cast<int>(std::nearbyintf(xc - ys));
  const int row = static_cast<int>(std::nearbyintf(xs + yc));
  return image.at<std::uint8_t>(20 + row, 20 + column);
}

TEST(Kernels, RotatedTestsOfBrief) {
  const cv::Mat image = random_image(41, 41, 8);
  for (const VectorUnit unit : vector_units()) {
    SCOPED_TRACE(name_of(unit));
    for (int step = 0; step < 720; ++step) {
      // Quarter turns and half pixels among them.
      const float radians = static_cast<float>(step) * static_cast<float>(CV_PI / 360);
      const float cosine = step == 0 ? 0.5F : std::cos(radians);
      const float sine = step == 0 ? 0.5F : std::sin(radians);
      std::uint8_t found[32];
      kernels_for(unit).brief(image.ptr(20) + 20, static_cast<std::ptrdiff_t>(image.step[0]),
                              cosine, sine, found);
      for (std::size_t i = 0; i < 256; ++i) {
        const auto& test = orb_pattern[i];
        const auto at = [&](std::size_t k) {
          return rotated_pixel(image, static_cast<float>(test[k]), static_cast<float>(test[k + 1]),
                               cosine, sine);
        };
        ASSERT_EQ(found[i / 8] >> (i % 8) & 1, at(0) < at(2)) << step << " bit " << i;
      }
    }
  }
}

TEST(Kernels, MaximaOfBlocksOfAnyWidth) {
  for (const VectorUnit unit : vector_units()) {
    SCOPED_TRACE(name_of(unit));
    for (const int width : {1, 7, 16, 31, 32, 33, 64, 70}) {
      const int height = 9;
      cv::Mat scores(height + 2, width + 2 + row_padding, CV_8UC1, cv::Scalar(0));
      const cv::Rect block(1, 1, width, height);
      random_image(width, height, static_cast<std::uint64_t>(width)).copyTo(scores(block));
      std::vector<std::pair<int, int>> expected, found;
      for (int y = 1; y <= height; ++y) {
        for (int x = 1; x <= width; ++x) {
          bool above = scores.at<std::uint8_t>(y, x) > 0;
          for (int k = 0; k < 9; ++k) {
            if (k != 4) {
              above &= scores.at<std::uint8_t>(y, x) >
                       scores.at<std::uint8_t>(y + k / 3 - 1, x + k % 3 - 1);
            }
          }
          if (above) expected.emplace_back(x - 1, y - 1);
        }
      }
      std::vector<Corner> corners(static_cast<std::size_t>((width + 1) / 2 * ((height + 1) / 2)));
      const int n = kernels_for(unit).local_maxima(scores.ptr(1) + 1,
                                                   static_cast<std::ptrdiff_t>(scores.step[0]),
                                                   width, height, corners.data());
      corners.resize(static_cast<std::size_t>(n));
      for (const Corner& corner : corners) {
        found.emplace_back(corner.x, corner.y);
        EXPECT_EQ(corner.response, scores.at<std::uint8_t>(corner.y + 1, corner.x + 1));
      }
      EXPECT_EQ(found, expected) << width;
    }
  }
}

TEST(Kernels, TablesEqualTheReference) {
  const auto pattern =
      testing::read_npy<std::int32_t>(testing::test_data("golden/misc/out_pattern.npy"));
  for (std::size_t i = 0; i < 256; ++i) {
    for (std::size_t k = 0; k < 4; ++k) EXPECT_EQ(orb_pattern[i][k], pattern.values[4 * i + k]);
  }
  const auto disc = testing::read_npy<std::int32_t>(testing::test_data("golden/misc/out_umax.npy"));
  for (std::size_t v = 0; v < 16; ++v) EXPECT_EQ(disc_half_length[v], disc.at(v));
}

/// Moments of patches, some of each kind.
std::vector<cv::Point2f> drawn_moments() {
  std::mt19937_64 generator(5);
  const auto draw = [&] {
    return static_cast<float>(static_cast<std::int64_t>(generator() % 1200001) - 600000);
  };
  std::vector<cv::Point2f> moments(20000);
  for (cv::Point2f& moment : moments) moment.y = draw(), moment.x = draw();
  return moments;
}

TEST(Orientation, EqualsOpenCv) {
#ifdef __aarch64__
  // Debian's OpenCV for ARM is compiled as GCC does without being told: the polynomial and the
  // difference to 90 degrees are made by multiply-adds that round once. That is one unit in the
  // last place of 360 degrees.
  const float tolerance = std::ldexp(1.0F, -15);
#else
  const float tolerance = 0;
#endif
  for (const auto& [x, y] : drawn_moments()) {
    EXPECT_LE(std::abs(fast_atan2_degrees(y, x) - cv::fastAtan2(y, x)), tolerance) << y << " " << x;
  }
  EXPECT_EQ(fast_atan2_degrees(0, 0), 0.0F);
  EXPECT_EQ(fast_atan2_degrees(5, 0), 90.0F);
  EXPECT_EQ(fast_atan2_degrees(0, -5), 180.0F);
  EXPECT_EQ(fast_atan2_degrees(-5, 0), 270.0F);
}

TEST(Orientation, IsTheSameOnEveryProcessor) {
  std::vector<float> angles;
  for (const auto& [x, y] : drawn_moments()) angles.push_back(fast_atan2_degrees(y, x));
  const cv::Mat bytes(1, static_cast<int>(angles.size() * sizeof(float)), CV_8UC1, angles.data());
  EXPECT_EQ(testing::digest(bytes), 8215674167833430029);  // recorded on x86-64
}

}  // namespace
}  // namespace orbslam
