// SPDX-License-Identifier: BSD-3-Clause
#include "frame/rectifier.hpp"

#include <Eigen/LU>
#include <cmath>
#include <exception>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <string>

#include "base/errors.hpp"

namespace orbslam {
namespace {

constexpr double kRotationTolerance = 1e-3;
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
        sees_any |= uv.x() >= 0 && uv.y() >= 0 && uv.x() < raw_size.width &&
                    uv.y() < raw_size.height;
      }
    }
  });
  if (!sees_any) {
    throw SettingsError(
        "the camera sees nothing of its rectified image; look at the rotation between the cameras "
        "and at their intrinsics");
  }
  cv::convertMaps(map, cv::Mat(), whole_, fraction_, CV_16SC2);
}

cv::Mat Rectifier::rectify(const cv::Mat& image, bool is_mask) const {
  const ImageSize expected = raw_.image_size();
  if (image.cols != expected.width || image.rows != expected.height) {
    throw ImageError("the image is " + text_of(image.cols, image.rows) +
                     ", but the calibration of the pair is for " +
                     text_of(expected.width, expected.height) +
                     "; give the images as the camera takes them, or calibrate it at their size");
  }
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
