// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <utility>
#include <vector>

#include "base/worker_thread.hpp"
#include "camera/camera_model.hpp"
#include "camera/pinhole.hpp"

namespace orbslam {

/// Makes the images of one raw camera those of a pinhole that is turned against it: one camera of a
/// pair whose rows shall correspond. Maps are in 1/32 pixel, results are those of cv::remap. See
/// docs/method/frame.md#rectification.
class Rectifier {
 public:
  /// `R` turns raw into rectified camera coordinates, `plane` is the rectified camera, `size` that
  /// of the rectified images. Throws SettingsError when R is no rotation, a focal length or the
  /// size is not positive, or no pixel of the rectified image is seen by the camera.
  Rectifier(CameraModel raw, const Eigen::Matrix3d& R, const Pinhole& plane, ImageSize size);

  const CameraModel& raw() const { return raw_; }
  ImageSize size() const { return size_; }

  /// Resamples an image of 8 bits and any number of channels: bilinearly, or, for a mask, from the
  /// nearest pixel. 0 where the raw image has no pixels. Throws ImageError when the image is not of
  /// the size of the raw camera.
  cv::Mat rectify(const cv::Mat& image, bool is_mask = false) const;

  /// Raw pixel of a rectified one; NaN where the camera shows nothing.
  Eigen::Vector2d to_raw(const Eigen::Vector2d& rectified) const;
  /// Rectified pixel of a raw one; NaN where it lies beside the plane.
  Eigen::Vector2d from_raw(const Eigen::Vector2d& raw) const;

 private:
  /// For each rectified pixel where its four neighbours begin in a raw image without gaps, and how
  /// far it lies from the first one in 1/32 pixel. Of pixels in `beside_` they are 0.
  struct GreyMap {
    std::vector<std::int32_t> offsets;
    std::vector<std::uint16_t> right, down;
  };

  cv::Mat rectify_grey(const cv::Mat& image) const;

  CameraModel raw_;
  Eigen::Matrix3d R_;
  Pinhole plane_;
  ImageSize size_;
  cv::Mat whole_, fraction_;  ///< OpenCV's maps
  GreyMap grey_;
  std::vector<std::int32_t> beside_;  ///< rectified pixels with a neighbour beside the raw image
};

/// Rectifies both images of a pair at the same time: the right one in the helper thread. One thread
/// at a time.
class PairRectifier {
 public:
  PairRectifier(Rectifier left, Rectifier right)
      : left_(std::move(left)), right_(std::move(right)) {}

  const Rectifier& left() const { return left_; }
  const Rectifier& right() const { return right_; }

  /// The left image, then the right one.
  std::pair<cv::Mat, cv::Mat> rectify(const cv::Mat& left, const cv::Mat& right);

 private:
  Rectifier left_, right_;
  WorkerThread helper_;
};

}  // namespace orbslam
