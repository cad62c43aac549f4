// SPDX-License-Identifier: BSD-3-Clause
#include "base/scale_pyramid.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>

#include "base/errors.hpp"
#include "support/npy.hpp"

namespace orbslam {
namespace {

testing::Array<float> golden(const std::string& name) {
  return testing::read_npy<float>(testing::test_data("golden/misc/" + name + ".npy"));
}

TEST(ScalePyramid, TablesEqualTheReference) {
  const ScalePyramid scales(1.2F, 8);
  const auto scale = golden("out_scaleFactors"), inverse = golden("out_invScaleFactors");
  const auto sigma2 = golden("out_levelSigma2"), inverse_sigma2 = golden("out_invLevelSigma2");
  ASSERT_EQ(scales.levels(), 8);
  for (int level = 0; level < 8; ++level) {
    const auto i = static_cast<std::size_t>(level);
    EXPECT_EQ(scales.scale(level), scale.at(i));
    EXPECT_EQ(scales.inverse_scale(level), inverse.at(i));
    EXPECT_EQ(scales.sigma2(level), sigma2.at(i));
    EXPECT_EQ(scales.inverse_sigma2(level), inverse_sigma2.at(i));
  }
  EXPECT_FLOAT_EQ(scales.log_factor(), std::log(1.2F));
}

TEST(ScalePyramid, PredictedLevelsEqualTheReference) {
  const ScalePyramid scales(1.2F, 8);
  const auto distance = golden("ps_dist"), max_distance = golden("ps_maxdist");
  const auto expected =
      testing::read_npy<std::int32_t>(testing::test_data("golden/misc/out_scale.npy"));
  ASSERT_GT(expected.rows(), 2000U);
  for (std::size_t i = 0; i < expected.rows(); ++i) {
    EXPECT_EQ(scales.predict_level(static_cast<double>(max_distance.at(i)),
                                   static_cast<double>(distance.at(i))),
              expected.at(i))
        << i;
  }
}

TEST(ScalePyramid, PredictedLevelsStayInThePyramid) {
  const ScalePyramid scales(1.2F, 8);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  // The nearer the coarser; nobody knows where a distance is no number.
  EXPECT_EQ(scales.predict_level(1, 1e-300), 7);
  EXPECT_EQ(scales.predict_level(1, 0), 7);
  EXPECT_EQ(scales.predict_level(kInfinity, 1), 7);
  EXPECT_EQ(scales.predict_level(1, 1e300), 0);
  EXPECT_EQ(scales.predict_level(1, kInfinity), 0);
  EXPECT_EQ(scales.predict_level(0, 1), 0);
  EXPECT_EQ(scales.predict_level(0, 0), 0);
  EXPECT_EQ(scales.predict_level(-1, 1), 0);
  EXPECT_EQ(scales.predict_level(nan, 1), 0);
  EXPECT_EQ(scales.predict_level(1, nan), 0);
}

TEST(ScalePyramid, FeaturesPerLevel) {
  const ScalePyramid scales(1.2F, 8);
  EXPECT_EQ(scales.features_per_level(1000),
            (std::vector<int>{217, 181, 151, 126, 105, 87, 73, 60}));
  EXPECT_EQ(scales.features_per_level(4000),
            (std::vector<int>{869, 724, 603, 503, 419, 349, 291, 242}));
  for (const int n : {1, 7, 100, 1234}) {
    const auto quota = scales.features_per_level(n);
    EXPECT_GE(std::accumulate(quota.begin(), quota.end(), 0), n);
  }
  EXPECT_EQ(ScalePyramid(1.5F, 1).features_per_level(77), (std::vector<int>{77}));
}

TEST(ScalePyramid, LevelSizesComeFromLevelZero) {
  const ScalePyramid scales(1.2F, 8);
  const int widths[] = {1241, 1034, 862, 718, 598, 499, 416, 346};
  const int heights[] = {376, 313, 261, 218, 181, 151, 126, 105};
  for (int level = 0; level < 8; ++level) {
    const ImageSize size = scales.level_size({1241, 376}, level);
    EXPECT_EQ(size.width, widths[level]);
    EXPECT_EQ(size.height, heights[level]);
  }
}

// OD-6: a factor of 1 would divide 0 by 0.
TEST(ScalePyramid, RefusesWhatIsNoPyramid) {
  EXPECT_THROW(ScalePyramid(1.0F, 8), SettingsError);
  EXPECT_THROW(ScalePyramid(2.1F, 8), SettingsError);
  EXPECT_THROW(ScalePyramid(std::numeric_limits<float>::quiet_NaN(), 8), SettingsError);
  EXPECT_THROW(ScalePyramid(1.2F, 0), SettingsError);
  EXPECT_THROW(ScalePyramid(1.2F, 17), SettingsError);
}

}  // namespace
}  // namespace orbslam
