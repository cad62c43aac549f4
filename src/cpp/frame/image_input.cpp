// SPDX-License-Identifier: BSD-3-Clause
#include "frame/image_input.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>

#include "base/errors.hpp"

namespace orbslam {
namespace {

constexpr double kSmallestFactor = 1e-5;

void check_image(const cv::Mat& image) {
  if (image.empty()) throw ImageError("image is empty; check that the file could be read");
  if (image.depth() != CV_8U) throw ImageError("image must be uint8 (8 bits per channel)");
  const int channels = image.channels();
  if (channels != 1 && channels != 3 && channels != 4) {
    throw ImageError("image must have 1 (grey), 3 (colour) or 4 (colour + alpha) channels, got " +
                     std::to_string(channels));
  }
}

// Metres per raw unit. Float32, as the depths it multiplies.
float metres_per_unit(double factor) {
  if (!std::isfinite(factor) || factor < 0) {
    throw SettingsError("DepthMapFactor (raw units per metre) must not be negative, got " +
                        std::to_string(factor));
  }
  return factor < kSmallestFactor ? 1.0F : 1.0F / static_cast<float>(factor);
}

void check_raw_depth(const cv::Mat& raw) {
  if (raw.empty()) throw ImageError("depth image is empty; check that the file could be read");
  if (raw.channels() != 1) {
    throw ImageError("depth image must have one channel, got " + std::to_string(raw.channels()));
  }
}

bool is_metres(const cv::Mat& raw, float scale) {
  return raw.depth() == CV_32F && std::abs(scale - 1.0F) <= static_cast<float>(kSmallestFactor);
}

/// Some rows at a time, few enough that OpenCV does them in this thread: those of its pool wait
/// busily for more work, which costs the other threads more than they save.
void convert(const cv::Mat& image, int code, cv::Mat& grey) {
  constexpr int kPixels = 1 << 15;
  grey.create(image.size(), CV_8UC1);
  const int step = std::max(1, kPixels / image.cols);
  for (int row = 0; row < image.rows; row += step) {
    const cv::Range rows(row, std::min(row + step, image.rows));
    cv::Mat part = grey.rowRange(rows);
    cv::cvtColor(image.rowRange(rows), part, code);
  }
}

}  // namespace

cv::Mat to_grey(const cv::Mat& image, bool is_rgb) {
  check_image(image);
  if (image.channels() == 1) return image;
  cv::Mat grey;
  to_grey(image, is_rgb, grey);
  return grey;
}

void to_grey(const cv::Mat& image, bool is_rgb, cv::Mat& grey) {
  check_image(image);
  switch (image.channels()) {
    case 3:
      convert(image, is_rgb ? cv::COLOR_RGB2GRAY : cv::COLOR_BGR2GRAY, grey);
      break;
    case 4:
      convert(image, is_rgb ? cv::COLOR_RGBA2GRAY : cv::COLOR_BGRA2GRAY, grey);
      break;
    default:
      image.copyTo(grey);
  }
}

cv::Mat to_depth_metres(const cv::Mat& raw, double factor) {
  check_raw_depth(raw);
  if (is_metres(raw, metres_per_unit(factor))) return raw;
  cv::Mat metres;
  to_depth_metres(raw, factor, metres);
  return metres;
}

void to_depth_metres(const cv::Mat& raw, double factor, cv::Mat& metres) {
  check_raw_depth(raw);
  const float scale = metres_per_unit(factor);
  if (is_metres(raw, scale)) {
    raw.copyTo(metres);
  } else {
    raw.convertTo(metres, CV_32F, static_cast<double>(scale));
  }
}

}  // namespace orbslam
