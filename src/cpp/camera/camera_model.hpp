// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "base/scale_pyramid.hpp"
#include "camera/camera_model_rows.hpp"

namespace orbslam {

/// Angles that an image shows, radians; they may exceed pi.
struct AngleOfView {
  double horizontal;  ///< along the row of the principal point
  double vertical;    ///< along its column
  double diagonal;    ///< the larger one of both diagonals
};

/// A central camera of any model, with raw pixels: projection of points and rays of pixels. The
/// centre of the top-left pixel is (0, 0). Immutable.
class CameraModel {
 public:
  /// `name` is a row's name or alias, in any case. Throws what check_camera_model throws.
  CameraModel(const std::string& name, std::vector<double> parameters, ImageSize image_size);

  const CameraModelRow& row() const { return *row_; }
  const std::vector<double>& parameters() const { return parameters_; }
  ImageSize image_size() const { return image_size_; }
  const LensModel& lens() const { return lens_; }

  /// Calls `function` with the lens, a type of LensModel. Call it once for a batch of points.
  template <class Function>
  decltype(auto) visit(Function&& function) const {
    return std::visit(std::forward<Function>(function), lens_);
  }

  /// Pixel of a point in the camera frame, with the derivative. False outside of the domain.
  bool project(const Eigen::Vector3d& p_c, Seen& seen) const;
  /// The unit ray seen at a pixel. False where the model shows nothing.
  bool unproject(const Eigen::Vector2d& uv, Eigen::Vector3d& ray) const;

  /// Pixels (2, n) of points (3, n); NaN outside of the domain. `jacobians` (6, n), if given, gets
  /// each 2x3 derivative by rows.
  void project(const Eigen::Ref<const Eigen::Matrix3Xd>& points,
               Eigen::Ref<Eigen::Matrix2Xd> pixels,
               Eigen::Matrix<double, 6, Eigen::Dynamic>* jacobians = nullptr) const;
  /// Unit rays (3, n) of pixels (2, n); NaN where the model shows nothing.
  void unproject(const Eigen::Ref<const Eigen::Matrix2Xd>& pixels,
                 Eigen::Ref<Eigen::Matrix3Xd> rays) const;
  /// Pixels per radian at pixels (2, n): the geometric mean over all directions, that is the square
  /// root of the area in the image per solid angle. NaN where the model shows nothing.
  Eigen::VectorXd pixels_per_radian(const Eigen::Ref<const Eigen::Matrix2Xd>& pixels) const;

  /// Angles between the rays at opposite borders and corners of the image. Where the model shows
  /// nothing at a border, the last pixel before it counts.
  AngleOfView angle_of_view() const;

  /// Same model, parameters and image size.
  bool operator==(const CameraModel& other) const;

 private:
  const CameraModelRow* row_;
  std::vector<double> parameters_;
  ImageSize image_size_;
  LensModel lens_;
};

}  // namespace orbslam
