// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera_model.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace orbslam {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Area in the image per solid angle, as a length: the derivative of the pixel by directions
/// orthogonal to the unit ray.
double scale_at(const Eigen::Vector3d& ray, const Eigen::Matrix<double, 2, 3>& J) {
  // For any a, b with a x b = ray: det(J a, J b) = (J.row(0) x J.row(1)) . ray.
  const Eigen::Vector3d normal = J.row(0).transpose().cross(J.row(1).transpose());
  return std::sqrt(std::abs(normal.dot(ray)));
}

}  // namespace

CameraModel::CameraModel(const std::string& name, std::vector<double> parameters,
                         ImageSize image_size)
    : row_(&check_camera_model(name, parameters, image_size)),
      parameters_(std::move(parameters)),
      image_size_(image_size),
      lens_(row_->make({parameters_[0], parameters_[1], parameters_[2], parameters_[3]},
                       parameters_.data() + 4)) {}

bool CameraModel::project(const Eigen::Vector3d& p_c, Seen& seen) const {
  return visit([&](const auto& lens) { return lens.project(p_c, seen); });
}

bool CameraModel::unproject(const Eigen::Vector2d& uv, Eigen::Vector3d& ray) const {
  return visit([&](const auto& lens) { return lens.unproject(uv, ray); });
}

void CameraModel::project(const Eigen::Ref<const Eigen::Matrix3Xd>& points,
                          Eigen::Ref<Eigen::Matrix2Xd> pixels,
                          Eigen::Matrix<double, 6, Eigen::Dynamic>* jacobians) const {
  visit([&](const auto& lens) {
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      Seen seen;
      if (!lens.project(points.col(i), seen) || !seen.uv.allFinite()) {
        seen.uv.setConstant(kNaN);
        seen.J.setConstant(kNaN);
      }
      pixels.col(i) = seen.uv;
      if (jacobians != nullptr) {
        jacobians->col(i) << seen.J.row(0).transpose(), seen.J.row(1).transpose();
      }
    }
  });
}

void CameraModel::unproject(const Eigen::Ref<const Eigen::Matrix2Xd>& pixels,
                            Eigen::Ref<Eigen::Matrix3Xd> rays) const {
  visit([&](const auto& lens) {
    for (Eigen::Index i = 0; i < pixels.cols(); ++i) {
      Eigen::Vector3d ray;
      if (!lens.unproject(pixels.col(i), ray) || !ray.allFinite()) ray.setConstant(kNaN);
      rays.col(i) = ray;
    }
  });
}

Eigen::VectorXd CameraModel::pixels_per_radian(
    const Eigen::Ref<const Eigen::Matrix2Xd>& pixels) const {
  Eigen::VectorXd scales(pixels.cols());
  visit([&](const auto& lens) {
    for (Eigen::Index i = 0; i < pixels.cols(); ++i) {
      Eigen::Vector3d ray;
      Seen seen;
      const bool shown = lens.unproject(pixels.col(i), ray) && lens.project(ray, seen);
      scales(i) = shown ? scale_at(ray, seen.J) : kNaN;
    }
  });
  return scales;
}

AngleOfView CameraModel::angle_of_view() const {
  const double left = -0.5, right = image_size_.width - 0.5;
  const double top = -0.5, bottom = image_size_.height - 0.5;
  const Eigen::Vector2d axis(parameters_[2], parameters_[3]);
  // The angle of the last pixel on the line from the axis to `border` at which a ray is seen.
  const auto angle_at = [&](const Eigen::Vector2d& border) {
    Eigen::Vector3d ray(0, 0, 1), seen;
    if (unproject(border, seen)) return std::atan2(seen.head<2>().norm(), seen.z());
    double inside = 0, outside = 1;
    for (int halvings = 0; halvings < 60; ++halvings) {
      const double middle = 0.5 * (inside + outside);
      const bool shown = unproject(axis + middle * (border - axis), seen);
      (shown ? inside : outside) = middle;
      if (shown) ray = seen;
    }
    return std::atan2(ray.head<2>().norm(), ray.z());
  };
  // An image that does not contain the axis shows the difference of both angles.
  const auto between = [&](const Eigen::Vector2d& one, const Eigen::Vector2d& other) {
    const bool opposite = (one - axis).dot(other - axis) <= 0;
    const double a = angle_at(one), b = angle_at(other);
    return opposite ? a + b : std::abs(a - b);
  };
  const double row = std::clamp(axis.y(), top, bottom), column = std::clamp(axis.x(), left, right);
  return {between({left, row}, {right, row}), between({column, top}, {column, bottom}),
          std::max(between({left, top}, {right, bottom}), between({left, bottom}, {right, top}))};
}

bool CameraModel::operator==(const CameraModel& other) const {
  return row_ == other.row_ && parameters_ == other.parameters_ &&
         image_size_.width == other.image_size_.width &&
         image_size_.height == other.image_size_.height;
}

}  // namespace orbslam
