// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>
#include <vector>

#include "features/keypoint.hpp"
#include "support/npy.hpp"

namespace orbslam::testing {

/// Grey noise, smoothed a little so that corners of all strengths occur.
inline cv::Mat random_image(int width, int height, std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  cv::Mat image(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(generator() >> 56);
    }
  }
  if (seed % 3 != 0) {
    const int aperture = seed % 3 == 1 ? 3 : 5;
    cv::blur(image, image, cv::Size(aperture, aperture));
  }
  return image;
}

inline cv::Mat read_image(const std::string& path) {
  const Array<std::uint8_t> array = read_npy<std::uint8_t>(path);
  cv::Mat image(static_cast<int>(array.rows()), static_cast<int>(array.columns()), CV_8UC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      image.at<std::uint8_t>(y, x) =
          array.at(static_cast<std::size_t>(y), static_cast<std::size_t>(x));
    }
  }
  return image;
}

/// FNV-1a hash of the pixels, row by row.
inline std::int64_t digest(const cv::Mat& image) {
  std::uint64_t hash = 14695981039346656037ULL;
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      hash = (hash ^ image.at<std::uint8_t>(y, x)) * 1099511628211ULL;
    }
  }
  return static_cast<std::int64_t>(hash);
}

inline bool same_pixels(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size()) return false;
  for (int y = 0; y < a.rows; ++y) {
    if (!std::equal(a.ptr(y), a.ptr(y) + a.cols, b.ptr(y))) return false;
  }
  return true;
}

inline bool same_features(const Features& a, const Features& b) {
  if (a.size() != b.size() || !(a.descriptors == b.descriptors)) return false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const Keypoint& p = a.keypoints[i];
    const Keypoint& q = b.keypoints[i];
    if (p.x != q.x || p.y != q.y || p.size != q.size || p.angle != q.angle ||
        p.response != q.response || p.level != q.level) {
      return false;
    }
  }
  return true;
}

}  // namespace orbslam::testing
