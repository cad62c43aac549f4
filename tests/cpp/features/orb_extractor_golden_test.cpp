// SPDX-License-Identifier: BSD-3-Clause
// Output of the reference for synthetic images, stage by stage.
#include <gtest/gtest.h>

#include <cstring>

#include "features/corner_grid.hpp"
#include "features/gaussian_blur.hpp"
#include "features/images.hpp"
#include "features/orb_extractor.hpp"
#include "features/quadtree.hpp"

namespace orbslam {
namespace {

using testing::read_npy;

struct Case {
  const char* name;
  int n_features;
  VectorUnit unit;
};

class Golden : public ::testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    kernels_ = &kernels_for(GetParam().unit);
    image_ = testing::read_image(path("image"));
  }
  std::string path(const std::string& array) const {
    return testing::test_data(std::string("golden/extractor_") + GetParam().name + "/" + array +
                              ".npy");
  }
  std::string per_count(const std::string& array) const {
    return path("n" + std::to_string(GetParam().n_features) + "_" + array);
  }
  /// Rows (level, x, y, response) of one level.
  static std::vector<Corner> corners_of(const testing::Array<float>& rows, int level) {
    std::vector<Corner> corners;
    for (std::size_t i = 0; i < rows.rows(); ++i) {
      if (static_cast<int>(rows.at(i, 0)) != level) continue;
      corners.push_back({static_cast<std::uint16_t>(rows.at(i, 1)),
                         static_cast<std::uint16_t>(rows.at(i, 2)),
                         static_cast<std::int32_t>(rows.at(i, 3))});
    }
    return corners;
  }
  static void expect_same(const std::vector<Corner>& found, const std::vector<Corner>& expected) {
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
      ASSERT_EQ(found[i].x, expected[i].x) << i;
      ASSERT_EQ(found[i].y, expected[i].y) << i;
      ASSERT_EQ(found[i].response, expected[i].response) << i;
    }
  }

  const Kernels* kernels_ = nullptr;
  ScalePyramid scales_{1.2F, 8, true};
  cv::Mat image_;
};

TEST_P(Golden, Stages) {
  const auto pyramid_hash = read_npy<std::int64_t>(path("pyr_fnv1a"));
  const auto blur_hash = read_npy<std::int64_t>(path("blur_fnv1a"));
  const auto candidates = read_npy<float>(path("cand"));
  const auto distributed = read_npy<float>(per_count("dist"));
  const std::vector<int> quota = scales_.features_per_level(GetParam().n_features);
  CornerGrid grid;
  Quadtree quadtree;
  GaussianBlur gaussian;
  const ImagePyramid pyramid = build_pyramid(image_, scales_);
  ASSERT_EQ(pyramid.levels.size(), 8U);
  for (int level = 0; level < 8; ++level) {
    SCOPED_TRACE(level);
    const auto at = static_cast<std::size_t>(level);
    const cv::Mat& image = pyramid.levels[at];
    EXPECT_EQ(testing::digest(image), pyramid_hash.at(at));
    EXPECT_EQ(testing::digest(gaussian.blur(image, *kernels_)), blur_hash.at(at));
    const auto corners = grid.detect(image, 20, 7, LevelMask{}, *kernels_);
    expect_same(corners, corners_of(candidates, level));
    expect_same(quadtree.distribute(corners, image.cols - 32, image.rows - 32, quota[at]),
                corners_of(distributed, level));
  }
}

TEST_P(Golden, Features) {
  OrbOptions options;
  options.n_features = GetParam().n_features;
  options.original_coordinates = true;
  OrbExtractor extractor(options, GetParam().unit);
  const Features features = extractor.extract(image_).features;
  const auto keypoints = read_npy<float>(per_count("kp"));
  const auto levels = read_npy<std::int32_t>(per_count("kp_octave"));
  const auto descriptors = read_npy<std::uint8_t>(per_count("desc"));
  ASSERT_EQ(features.size(), keypoints.rows());
  for (std::size_t i = 0; i < features.size(); ++i) {
    const Keypoint& keypoint = features.keypoints[i];
    ASSERT_EQ(keypoint.x, keypoints.at(i, 0)) << i;
    ASSERT_EQ(keypoint.y, keypoints.at(i, 1)) << i;
    ASSERT_EQ(keypoint.size, keypoints.at(i, 2)) << i;
    ASSERT_EQ(keypoint.angle, keypoints.at(i, 3)) << i;
    ASSERT_EQ(keypoint.response, keypoints.at(i, 4)) << i;
    ASSERT_EQ(keypoint.level, levels.at(i)) << i;
    ASSERT_EQ(std::memcmp(features.descriptors[i].words.data(), &descriptors.at(i, 0), 32), 0) << i;
  }
}

TEST_P(Golden, Quota) {
  const auto quota = read_npy<std::int32_t>(per_count("quota"));
  EXPECT_EQ(scales_.features_per_level(GetParam().n_features), quota.values);
}

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const VectorUnit unit : vector_units()) {
    all.insert(all.end(),
               {{"synth7", 1000, unit}, {"synth7", 2000, unit}, {"synth11", 2000, unit}});
  }
  return all;
}

INSTANTIATE_TEST_SUITE_P(Synthetic, Golden, ::testing::ValuesIn(cases()),
                         [](const ::testing::TestParamInfo<Case>& chosen) {
                           return std::string(chosen.param.name) + "_" +
                                  std::to_string(chosen.param.n_features) + "_" +
                                  name_of(chosen.param.unit);
                         });

}  // namespace
}  // namespace orbslam
