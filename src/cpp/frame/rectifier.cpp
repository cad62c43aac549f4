// SPDX-License-Identifier: BSD-3-Clause
#include "frame/rectifier.hpp"

#include <Eigen/LU>
#include <cmath>
#include <cstring>
#include <exception>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <string>

#include "base/errors.hpp"

namespace orbslam {
namespace {

constexpr double kRotationTolerance = 1e-3;
/// Fractions of a pixel: OpenCV's.
constexpr int kSteps = 32;
constexpr int kShift = 10;  // of their products
/// Where no pixel is: outside of every image.
constexpr float kNowhere = -1e4F;

std::string text_of(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

void check(const Eigen::Matrix3d& R, const Pinhole& plane, ImageSize size) {
  const Eigen::Matrix3d off = R * R.transpose() - Eigen::Matrix3d::Identity();
  if (!(off.cwiseAbs().maxCoeff() < kRotationTolerance) || !(R.determinant() > 0)) {
    throw SettingsError("the rotation R of a rectification has no orthonormal rows");
  }
  if (!(plane.fx > 0) || !(plane.fy > 0) || !std::isfinite(plane.fx + plane.fy) ||
      !std::isfinite(plane.cx + plane.cy)) {
    throw SettingsError("the rectified focal lengths must be positive, got " +
                        std::to_string(plane.fx) + " and " + std::to_string(plane.fy));
  }
  if (size.width < 1 || size.height < 1) {
    throw SettingsError("the rectified images are of " + text_of(size.width, size.height) +
                        " pixels; give 1 or more");
  }
}

const Eigen::Vector2d kNothing =
    Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());

}  // namespace

Rectifier::Rectifier(CameraModel raw, const Eigen::Matrix3d& R, const Pinhole& plane,
                     ImageSize size)
    : raw_(std::move(raw)), R_(R), plane_(plane), size_(size) {
  check(R, plane, size);
  cv::Mat map(size.height, size.width, CV_32FC2);
  const Eigen::Matrix3d R_raw = R.transpose();
  const ImageSize raw_size = raw_.image_size();
  bool sees_any = false;
  raw_.visit([&](const auto& lens) {
    Seen seen;
    for (int row = 0; row < size.height; ++row) {
      auto* const line = map.ptr<cv::Vec2f>(row);
      for (int column = 0; column < size.width; ++column) {
        line[column] = {kNowhere, kNowhere};
        if (!lens.project(R_raw * plane.unproject(column, row, 1), seen)) continue;
        const Eigen::Vector2d& uv = seen.uv;
        if (!(uv.cwiseAbs().maxCoeff() < -static_cast<double>(kNowhere))) continue;
        line[column] = {static_cast<float>(uv.x()), static_cast<float>(uv.y())};
        sees_any |=
            uv.x() >= 0 && uv.y() >= 0 && uv.x() < raw_size.width && uv.y() < raw_size.height;
      }
    }
  });
  if (!sees_any) {
    throw SettingsError(
        "the camera sees nothing of its rectified image; look at the rotation between the cameras "
        "and at their intrinsics");
  }
  cv::convertMaps(map, cv::Mat(), whole_, fraction_, CV_16SC2);
  const std::size_t n = whole_.total();
  grey_ = {std::vector<std::int32_t>(n, 0), std::vector<std::uint16_t>(n, 0),
           std::vector<std::uint16_t>(n, 0)};
  for (std::size_t i = 0; i < n; ++i) {
    const cv::Vec2s at = whole_.ptr<cv::Vec2s>()[i];
    const int fraction = fraction_.ptr<std::uint16_t>()[i];
    if (at[0] < 0 || at[1] < 0 || at[0] + 1 >= raw_size.width || at[1] + 1 >= raw_size.height) {
      beside_.push_back(static_cast<std::int32_t>(i));
      continue;
    }
    grey_.offsets[i] = at[1] * raw_size.width + at[0];
    grey_.right[i] = static_cast<std::uint16_t>(fraction % kSteps);
    grey_.down[i] = static_cast<std::uint16_t>(fraction / kSteps);
  }
}

namespace {

using Eight = std::uint16_t __attribute__((vector_size(16)));
using EightInts = std::int32_t __attribute__((vector_size(32)));
using EightBytes = std::uint8_t __attribute__((vector_size(8)));

std::uint16_t two_pixels(const std::uint8_t* from) {
  std::uint16_t two;
  std::memcpy(&two, from, sizeof(two));
  return two;
}

Eight load(const std::uint16_t* from) {
  Eight eight;
  std::memcpy(&eight, from, sizeof(eight));
  return eight;
}

/// 32 times the grey values between the two pixels of each lane; the lower byte is the left one.
Eight between(const Eight& two, const Eight& right) {
  const Eight left_pixel = two & 0xFF, right_pixel = two >> 8;
  return left_pixel * (kSteps - right) + right_pixel * right;
}

/// Eight pixels of a bilinear resampling, rounded half up.
EightBytes resample(const std::uint8_t* image, std::ptrdiff_t stride, const std::int32_t* offsets,
                    const Eight& right, const Eight& down) {
  const std::uint8_t* p[8];
  for (int k = 0; k < 8; ++k) p[k] = image + offsets[k];
  const std::uint8_t* q[8];
  for (int k = 0; k < 8; ++k) q[k] = p[k] + stride;
  const Eight above{two_pixels(p[0]), two_pixels(p[1]), two_pixels(p[2]), two_pixels(p[3]),
                    two_pixels(p[4]), two_pixels(p[5]), two_pixels(p[6]), two_pixels(p[7])};
  const Eight below{two_pixels(q[0]), two_pixels(q[1]), two_pixels(q[2]), two_pixels(q[3]),
                    two_pixels(q[4]), two_pixels(q[5]), two_pixels(q[6]), two_pixels(q[7])};
  const auto upper = __builtin_convertvector(between(above, right), EightInts);
  const auto lower = __builtin_convertvector(between(below, right), EightInts);
  const auto along = __builtin_convertvector(down, EightInts);
  const EightInts sum = upper * (kSteps - along) + lower * along + kSteps * kSteps / 2;
  return __builtin_convertvector(sum >> kShift, EightBytes);
}

}  // namespace

cv::Mat Rectifier::rectify_grey(const cv::Mat& image) const {
  cv::Mat rectified(size_.height, size_.width, CV_8UC1);
  std::uint8_t* const to = rectified.ptr();
  const std::uint8_t* const from = image.ptr();
  const std::ptrdiff_t stride = image.cols;
  const std::size_t n = grey_.offsets.size(), whole = n - n % 8;
  for (std::size_t i = 0; i < whole; i += 8) {
    const EightBytes eight =
        resample(from, stride, &grey_.offsets[i], load(&grey_.right[i]), load(&grey_.down[i]));
    std::memcpy(to + i, &eight, sizeof(eight));
  }
  for (std::size_t i = whole; i < n; ++i) {
    const std::uint8_t* p = from + grey_.offsets[i];
    const int right = grey_.right[i], down = grey_.down[i];
    const int upper = p[0] * (kSteps - right) + p[1] * right;
    const int lower = p[stride] * (kSteps - right) + p[stride + 1] * right;
    to[i] = static_cast<std::uint8_t>(
        (upper * (kSteps - down) + lower * down + kSteps * kSteps / 2) / (kSteps * kSteps));
  }
  // What lies beside the image is black.
  for (const std::int32_t i : beside_) {
    const cv::Vec2s at = whole_.ptr<cv::Vec2s>()[i];
    const int fraction = fraction_.ptr<std::uint16_t>()[i];
    int sum = kSteps * kSteps / 2;
    for (int down = 0; down < 2; ++down) {
      for (int right = 0; right < 2; ++right) {
        const int u = at[0] + right, v = at[1] + down;
        if (u < 0 || v < 0 || u >= image.cols || v >= image.rows) continue;
        const int along = fraction % kSteps, across = fraction / kSteps;
        sum += image.at<std::uint8_t>(v, u) * (right ? along : kSteps - along) *
               (down ? across : kSteps - across);
      }
    }
    to[i] = static_cast<std::uint8_t>(sum / (kSteps * kSteps));
  }
  return rectified;
}

cv::Mat Rectifier::rectify(const cv::Mat& image, bool is_mask) const {
  const ImageSize expected = raw_.image_size();
  if (image.cols != expected.width || image.rows != expected.height) {
    throw ImageError("the image is " + text_of(image.cols, image.rows) +
                     ", but the calibration of the pair is for " +
                     text_of(expected.width, expected.height) +
                     "; give the images as the camera takes them, or calibrate it at their size");
  }
  if (!is_mask && image.type() == CV_8UC1 && image.isContinuous()) return rectify_grey(image);
  cv::Mat rectified;
  cv::remap(image, rectified, whole_, is_mask ? cv::Mat() : fraction_,
            is_mask ? cv::INTER_NEAREST : cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  return rectified;
}

Eigen::Vector2d Rectifier::to_raw(const Eigen::Vector2d& rectified) const {
  Seen seen;
  const Eigen::Vector3d p = R_.transpose() * plane_.unproject(rectified.x(), rectified.y(), 1);
  return raw_.project(p, seen) ? seen.uv : kNothing;
}

Eigen::Vector2d Rectifier::from_raw(const Eigen::Vector2d& raw) const {
  Eigen::Vector3d ray;
  if (!raw_.unproject(raw, ray)) return kNothing;
  const Eigen::Vector3d p = R_ * ray;
  return p.z() > 0 ? plane_.project(p) : kNothing;
}

std::pair<cv::Mat, cv::Mat> PairRectifier::rectify(const cv::Mat& left, const cv::Mat& right) {
  std::pair<cv::Mat, cv::Mat> pair;
  helper_.start([&] { pair.second = right_.rectify(right); });
  std::exception_ptr left_failure;
  try {
    pair.first = left_.rectify(left);
  } catch (...) {
    // The job refers to this call's variables, so it must end before the exception leaves.
    left_failure = std::current_exception();
  }
  try {
    helper_.finish();
  } catch (...) {
    if (!left_failure) throw;
  }
  if (left_failure) std::rethrow_exception(left_failure);
  return pair;
}

}  // namespace orbslam
