// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstring>
#include <opencv2/imgproc.hpp>
#include <string>

#include "features/orb_extractor.hpp"
#include "support/npy.hpp"

namespace orbslam::testing {

/// A pyramid made by the plain resize, independent of the extractor under test elsewhere.
inline ImagePyramid resized_pyramid(const cv::Mat& image, const ScalePyramid& scales) {
  ImagePyramid pyramid;
  pyramid.levels.push_back(image);
  for (int level = 1; level < scales.levels(); ++level) {
    const ImageSize size = scales.level_size({image.cols, image.rows}, level);
    cv::Mat next;
    cv::resize(pyramid.levels.back(), next, {size.width, size.height}, 0, 0, cv::INTER_LINEAR);
    pyramid.levels.push_back(next);
  }
  return pyramid;
}

/// Image, keypoints and descriptors of one side of a stored pair. `border` rows were cut off
/// above and below the stored image; no window of any keypoint reaches into them.
inline Extraction read_extraction(const std::string& folder, const std::string& side, int border,
                                  const ScalePyramid& scales) {
  auto pixels = read_npy<std::uint8_t>(folder + "/" + side + ".npy");
  const cv::Mat stored(static_cast<int>(pixels.rows()), static_cast<int>(pixels.columns()), CV_8UC1,
                       pixels.values.data());
  cv::Mat image;
  cv::copyMakeBorder(stored, image, border, border, 0, 0, cv::BORDER_REPLICATE);

  const auto xy = read_npy<float>(folder + "/" + side + "_xy.npy");
  const auto level = read_npy<int>(folder + "/" + side + "_level.npy");
  const auto bytes = read_npy<std::uint8_t>(folder + "/" + side + "_desc.npy");
  Extraction extraction;
  extraction.pyramid = resized_pyramid(image, scales);
  for (std::size_t i = 0; i < xy.rows(); ++i) {
    Keypoint keypoint;
    keypoint.x = xy.at(i, 0);
    keypoint.y = xy.at(i, 1);
    keypoint.level = level.at(i);
    extraction.features.keypoints.push_back(keypoint);
    Descriptor descriptor;
    std::memcpy(descriptor.words.data(), &bytes.values[32 * i], 32);
    extraction.features.descriptors.push_back(descriptor);
  }
  return extraction;
}

}  // namespace orbslam::testing
