// SPDX-License-Identifier: BSD-3-Clause
#include "features/orb_extractor.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/errors.hpp"
#include "features/corner_grid.hpp"
#include "features/gaussian_blur.hpp"
#include "features/level_placement.hpp"
#include "features/orientation.hpp"
#include "features/pyramid_builder.hpp"
#include "features/quadtree.hpp"

namespace orbslam {
namespace {

constexpr int patch_size = 31;
constexpr int largest_side = 32767;
constexpr float radians_per_degree = static_cast<float>(3.1415926535897932384626433832795 / 180.0);

void check_range(const char* name, int value, int low, int high) {
  if (value < low || value > high) {
    throw SettingsError(std::string(name) + " must be " + std::to_string(low) + " to " +
                        std::to_string(high) + ", got " + std::to_string(value));
  }
}

std::string size_text(const cv::Mat& image) {
  return std::to_string(image.cols) + "x" + std::to_string(image.rows);
}

void check_images(const cv::Mat& grey, const cv::Mat& mask) {
  if (grey.empty()) throw ImageError("the image is empty; give a grey uint8 image");
  if (grey.dims != 2 || grey.type() != CV_8UC1) {
    throw ImageError("the image must be grey uint8 with one channel; convert it before");
  }
  if (grey.cols > largest_side || grey.rows > largest_side) {
    throw ImageError("the image of " + size_text(grey) + " pixels is too large; the limit is " +
                     std::to_string(largest_side) + " per side");
  }
  if (mask.empty()) return;
  if (mask.dims != 2 || mask.type() != CV_8UC1) {
    throw ImageError("the mask must be uint8 with one channel, 0 where no keypoint may lie");
  }
  if (mask.size() != grey.size()) {
    throw ImageError("the mask of " + size_text(mask) + " pixels does not fit the image of " +
                     size_text(grey) + "; give both the same size");
  }
}

}  // namespace

void OrbOptions::check() const {
  check_range("n_features", n_features, 1, 1000000);
  check_range("n_levels", n_levels, 1, 16);
  check_range("initial_threshold", initial_threshold, 1, 254);
  check_range("minimum_threshold", minimum_threshold, 1, 254);
  if (minimum_threshold > initial_threshold) {
    throw SettingsError("minimum_threshold " + std::to_string(minimum_threshold) +
                        " must not exceed initial_threshold " + std::to_string(initial_threshold));
  }
  ScalePyramid(scale_factor, n_levels);  // names the scale factor itself when it is out of range
}

struct OrbExtractor::Impl {
  Impl(const OrbOptions& wanted, VectorUnit chosen)
      : options(wanted),
        scales(wanted.scale_factor, wanted.n_levels, wanted.original_coordinates),
        quota(scales.features_per_level(wanted.n_features)),
        unit(chosen),
        kernels(&kernels_for(chosen)) {}

  void extract_level(const cv::Mat& image, const cv::Mat& mask, int level,
                     const LevelPlacement& placement, Features& features);
  Keypoint keypoint_at(const cv::Mat& image, const Corner& corner, int level,
                       const LevelPlacement& placement) const;
  Descriptor descriptor_at(const cv::Mat& blurred, const Corner& corner, float angle) const;

  OrbOptions options;
  ScalePyramid scales;
  std::vector<int> quota;
  VectorUnit unit;
  const Kernels* kernels;
  PyramidBuilder pyramid;
  CornerGrid grid;
  Quadtree quadtree;
  GaussianBlur gaussian;
};

void OrbExtractor::Impl::extract_level(const cv::Mat& image, const cv::Mat& mask, int level,
                                       const LevelPlacement& placement, Features& features) {
  const LevelMask allowed{mask.empty() ? nullptr : &mask, placement};
  const auto& corners =
      grid.detect(image, options.initial_threshold, options.minimum_threshold, allowed, *kernels);
  const auto& kept =
      quadtree.distribute(corners, image.cols - 2 * corner_origin, image.rows - 2 * corner_origin,
                          quota[static_cast<std::size_t>(level)]);
  if (kept.empty()) return;
  const cv::Mat blurred = gaussian.blur(image, *kernels);
  for (const Corner& corner : kept) {
    features.keypoints.push_back(keypoint_at(image, corner, level, placement));
    features.descriptors.push_back(descriptor_at(blurred, corner, features.keypoints.back().angle));
  }
}

Keypoint OrbExtractor::Impl::keypoint_at(const cv::Mat& image, const Corner& corner, int level,
                                         const LevelPlacement& placement) const {
  const int x = corner.x + corner_origin, y = corner.y + corner_origin;
  std::int32_t m10 = 0, m01 = 0;
  kernels->moments(image.ptr<std::uint8_t>(y) + x, static_cast<std::ptrdiff_t>(image.step[0]), &m10,
                   &m01);
  Keypoint keypoint;
  keypoint.x = placement.x.to_image(static_cast<float>(x));
  keypoint.y = placement.y.to_image(static_cast<float>(y));
  keypoint.size = std::trunc(static_cast<float>(patch_size) * scales.scale(level));
  keypoint.angle = fast_atan2_degrees(static_cast<float>(m01), static_cast<float>(m10));
  keypoint.response = static_cast<float>(corner.response);
  keypoint.level = level;
  return keypoint;
}

Descriptor OrbExtractor::Impl::descriptor_at(const cv::Mat& blurred, const Corner& corner,
                                             float angle) const {
  const float radians = angle * radians_per_degree;
  const auto* centre =
      blurred.ptr<std::uint8_t>(corner.y + corner_origin) + corner.x + corner_origin;
  Descriptor descriptor;
  kernels->brief(centre, static_cast<std::ptrdiff_t>(blurred.step[0]), std::cos(radians),
                 std::sin(radians), reinterpret_cast<std::uint8_t*>(descriptor.words.data()));
  return descriptor;
}

OrbExtractor::OrbExtractor(const OrbOptions& options, VectorUnit unit) {
  options.check();
  impl_ = std::make_unique<Impl>(options, unit);
}

OrbExtractor::~OrbExtractor() = default;
OrbExtractor::OrbExtractor(OrbExtractor&&) noexcept = default;
OrbExtractor& OrbExtractor::operator=(OrbExtractor&&) noexcept = default;

Extraction OrbExtractor::extract(const cv::Mat& grey, const cv::Mat& mask) {
  check_images(grey, mask);
  Extraction result;
  result.pyramid = impl_->pyramid.build(grey, impl_->scales, *impl_->kernels);
  const auto expected = static_cast<std::size_t>(impl_->options.n_features + 64);
  result.features.keypoints.reserve(expected);
  result.features.descriptors.reserve(expected);
  for (int level = 0; level < impl_->scales.levels(); ++level) {
    impl_->extract_level(result.pyramid.levels[static_cast<std::size_t>(level)], mask, level,
                         LevelPlacement(impl_->scales, level, {grey.cols, grey.rows}),
                         result.features);
  }
  return result;
}

const OrbOptions& OrbExtractor::options() const { return impl_->options; }
const ScalePyramid& OrbExtractor::scales() const { return impl_->scales; }
VectorUnit OrbExtractor::vector_unit() const { return impl_->unit; }

}  // namespace orbslam
