// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <variant>
#include <vector>

#include "base/errors.hpp"
#include "camera/rig_plane.hpp"

namespace orbslam {
namespace {

/// Cosine to the optical axis from which on depth along the axis gives depth along the ray.
constexpr double kLeastAxial = 0.05;

bool positive(double value) { return std::isfinite(value) && value > 0; }

void check(const CameraOptions& options) {
  const Pinhole& k = options.pinhole;
  if (!positive(k.fx) || !positive(k.fy)) {
    throw SettingsError("focal lengths Camera.fx and Camera.fy must be positive, got " +
                        std::to_string(k.fx) + " and " + std::to_string(k.fy));
  }
  if (!std::isfinite(k.cx) || !std::isfinite(k.cy)) {
    throw SettingsError("principal point Camera.cx, Camera.cy must be finite, got " +
                        std::to_string(k.cx) + " and " + std::to_string(k.cy));
  }
  if (options.image_size.width < 1 || options.image_size.height < 1) {
    throw SettingsError("image size must be positive, got " +
                        std::to_string(options.image_size.width) + "x" +
                        std::to_string(options.image_size.height));
  }
  for (const double coefficient : options.distortion) {
    if (!std::isfinite(coefficient)) {
      throw SettingsError("distortion coefficients k1, k2, p1, p2, k3 to k6 must be finite, got " +
                          std::to_string(coefficient));
    }
  }
  if (!options.right_centre.allFinite() || (!options.right_centre.isZero() && !options.model)) {
    throw SettingsError("a fisheye pair needs the model of its left camera and a finite baseline");
  }
  if (!std::isfinite(options.bf) || options.bf < 0) {
    throw SettingsError("Camera.bf (baseline times fx) must not be negative, got " +
                        std::to_string(options.bf));
  }
  if (options.bf > 0 && !positive(options.depth_ratio)) {
    throw SettingsError("ThDepth (close/far limit in baselines) must be positive, got " +
                        std::to_string(options.depth_ratio));
  }
}

/// A calibration may be wrong at the borders, but should hold halfway to them.
void check_inside(const Camera& camera) {
  const double width = camera.image_size().width, height = camera.image_size().height;
  const Eigen::Vector2d halfway[] = {{width / 4, height / 2},
                                     {3 * width / 4, height / 2},
                                     {width / 2, height / 4},
                                     {width / 2, 3 * height / 4}};
  for (const Eigen::Vector2d& middle : halfway) {
    if (camera.shows(middle)) continue;
    throw SettingsError(
        "the distortion coefficients fold the image over: no direction belongs to pixel (" +
        std::to_string(middle.x()) + ", " + std::to_string(middle.y()) +
        "); check k1, k2, p1, p2, k3 to k6 and the focal lengths");
  }
}

ImageBounds bounds_of(const Camera& camera) {
  const auto width = static_cast<float>(camera.image_size().width);
  const auto height = static_cast<float>(camera.image_size().height);
  if (!camera.distorts()) return {0, width, 0, height};
  check_inside(camera);

  const Eigen::Vector2f upper_left = camera.from_image({0, 0});
  const Eigen::Vector2f upper_right = camera.from_image({width, 0});
  const Eigen::Vector2f lower_left = camera.from_image({0, height});
  const Eigen::Vector2f lower_right = camera.from_image({width, height});
  const ImageBounds bounds{
      std::min(upper_left.x(), lower_left.x()), std::max(upper_right.x(), lower_right.x()),
      std::min(upper_left.y(), upper_right.y()), std::max(lower_left.y(), lower_right.y())};
  return bounds;
}

/// The pinhole of a model: its own, or for a fisheye lens one with its scale in the middle.
Pinhole pinhole_of(const CameraModel& model) {
  const std::vector<double>& p = model.parameters();
  const Pinhole plane{p[0], p[1], p[2], p[3]};
  if (is_flat(model.lens())) return plane;
  Seen seen;
  if (!model.project({0, 0, 1}, seen)) return plane;
  return {seen.J(0, 0), seen.J(1, 1), plane.cx, plane.cy};
}

CameraOptions checked(const CameraOptions& options) {
  if (!options.members.empty()) return checked_rig(options);
  CameraOptions full = options;
  if (options.model) {
    const ImageSize own = options.model->image_size();
    if (own.width != options.image_size.width || own.height != options.image_size.height) {
      throw SettingsError("the camera model is of images of " + std::to_string(own.width) + "x" +
                          std::to_string(own.height) + " pixels, not " +
                          std::to_string(options.image_size.width) + "x" +
                          std::to_string(options.image_size.height));
    }
    full.pinhole = pinhole_of(*options.model);
    full.distortion = {};
  }
  if (!options.right_centre.isZero()) full.bf = options.right_centre.norm() * full.pinhole.fx;
  check(full);
  return full;
}

/// The sight of a keypoint of a fisheye pair: its pixel rows are turned to the epipolar direction,
/// and all of it is scaled so that bf over the third row is the disparity. Along the baseline,
/// where a pair sees no depth, it stays as it is.
Eigen::Matrix3d turned_to_pair(const Eigen::Matrix3d& B, const CameraOptions& options) {
  const Eigen::Vector2d shift = B.topRows<2>() * options.right_centre;
  const double per_inverse_depth = shift.norm();
  if (!(per_inverse_depth > Camera::kLeastShift * options.bf)) return B;
  const Eigen::Vector2d along = shift / per_inverse_depth;
  Eigen::Matrix2d turn;
  turn << along.x(), along.y(), -along.y(), along.x();
  Eigen::Matrix3d turned = B;
  turned.topRows<2>() = turn * Eigen::Matrix<double, 2, 3>(B.topRows<2>());
  return turned * (options.bf / per_inverse_depth);
}

LensModel lens_of(const CameraOptions& options) {
  if (!options.members.empty()) return lens_models::PinholeLens{options.pinhole};
  if (options.model) return options.model->lens();
  std::array<double, 12> coefficients{};
  std::copy(options.distortion.begin(), options.distortion.end(), coefficients.begin());
  const bool bends = std::any_of(coefficients.begin(), coefficients.end(),
                                 [](double coefficient) { return coefficient != 0; });
  if (!bends) return lens_models::PinholeLens{options.pinhole};
  return lens_models::PlaneDistortionLens{options.pinhole, PlaneDistortion(coefficients)};
}

}  // namespace

Camera::Camera(const CameraOptions& options)
    : options_(checked(options)),
      lens_(lens_of(options_)),
      slots_(slots_of(options_)),
      rig_(!slots_.empty()),
      // The images of a fisheye pair are not rectified.
      flat_(!rig_ && orbslam::is_flat(lens_) && options_.right_centre.isZero()),
      distorts_(rig_ ? any_distorts(options_.members)
                     : flat_ && std::holds_alternative<lens_models::PlaneDistortionLens>(lens_)),
      wide_pair_(!options_.right_centre.isZero()),
      bounds_(rig_ ? bounds_of_rig(options_) : bounds_of(*this)) {
  if (rig_) {
    close_depth_ = deepest_close(options_.members);
  } else if (has_baseline())
    close_depth_ = options_.bf * options_.depth_ratio / options_.pinhole.fx;
}

bool Camera::project_wide(const Eigen::Vector3d& p_c, Eigen::Vector2d& uv) const {
  if (rig_) {
    Eigen::Vector3d in_camera;
    return looking_at(p_c, in_camera, uv) != nullptr;
  }
  Seen seen;
  if (!std::visit([&](const auto& lens) { return lens.project(p_c, seen); }, lens_)) return false;
  if (!seen.uv.allFinite()) return false;
  uv = seen.uv;
  return true;
}

Eigen::Vector3d Camera::wide_ray(double u, double v) const {
  if (rig_) {
    const Slot& at = slot(u);
    return at.R_bc * at.camera->ray(u - at.column, v).normalized();
  }
  Eigen::Vector3d ray;
  const bool shown = std::visit(
      [&](const auto& lens) {
        return lens.unproject({u, v}, ray);
      },
      lens_);
  return shown ? ray : Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
}

Eigen::Matrix2d Camera::raw_by_plane(double u, double v) const {
  const Pinhole& k = pinhole();
  const auto& lens = std::get<lens_models::PlaneDistortionLens>(lens_);
  Bent bent;
  // Where the lens shows nothing, the derivative is NaN, and errors pass no gate.
  if (!lens.distortion.distort(k.to_plane({u, v}), bent)) {
    return Eigen::Matrix2d::Constant(std::numeric_limits<double>::quiet_NaN());
  }
  const double aspect = k.fx / k.fy;
  Eigen::Matrix2d by_plane = bent.J;
  by_plane(0, 1) *= aspect;
  by_plane(1, 0) /= aspect;
  return by_plane;
}

Sight Camera::sight(double u, double v) const {
  if (rig_) return sight_of_rig(u, v);
  const Eigen::Matrix3d B = sight_of_one(u, v);
  Sight sight;
  sight.leftCols<3>() = B;
  sight.col(3).setZero();
  return sight;
}

Eigen::Matrix3d Camera::sight_of_one(double u, double v) const {
  const Pinhole& k = pinhole();
  Eigen::Matrix3d B;
  if (flat_) {
    B << k.fx, 0, k.cx - u, 0, k.fy, k.cy - v, 0, 0, 1;
    if (distorts_)
      B.topRows<2>() = raw_by_plane(u, v) * Eigen::Matrix<double, 2, 3>(B.topRows<2>());
    return B;
  }
  const Eigen::Vector3d ray = wide_ray(u, v);
  Seen seen;
  const bool shown = ray.allFinite() &&
                     std::visit([&](const auto& lens) { return lens.project(ray, seen); }, lens_);
  if (!shown) return Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());
  B.topRows<2>() = seen.J;
  B.row(2) = ray.transpose();
  return wide_pair_ ? turned_to_pair(B, options_) : B;
}

double Camera::along_curve_of_pair(const Eigen::Vector2d& error, double u, double v) const {
  Seen seen;
  if (!project(wide_ray(u, v), seen)) return error.x();
  const Eigen::Vector2d shift = seen.J * options_.right_centre;
  return shift.norm() > kLeastShift * options_.bf ? error.dot(shift.normalized()) : error.x();
}

double Camera::disparity(const Eigen::Vector3d& p_c) const {
  if (rig_) {
    Eigen::Vector2d uv;
    double shift = 0;
    return project(p_c, uv, shift) ? shift : std::numeric_limits<double>::quiet_NaN();
  }
  if (flat_) return options_.bf / p_c.z();
  if (!wide_pair_) return options_.bf / p_c.norm();
  Seen seen;
  if (!project(p_c, seen)) return std::numeric_limits<double>::quiet_NaN();
  return (seen.J * options_.right_centre).norm();
}

double Camera::disparity(double u, double v, double depth) const {
  if (rig_) return slot(u).camera->disparity(u - slot(u).column, v, depth);
  return flat_ ? options_.bf / depth : options_.bf / sight_of_one(u, v).row(2).norm() / depth;
}

double Camera::depth_of_axial(double u, double v, double z) const {
  if (flat_) return z;
  if (rig_) return slot(u).camera->depth_of_axial(u - slot(u).column, v, z);
  const double along_axis = wide_ray(u, v).z();
  return along_axis > kLeastAxial ? z / along_axis : 0;
}

bool Camera::project(const Eigen::Vector3d& p_c, Seen& seen) const {
  if (rig_) {
    Eigen::Vector3d in_camera;
    Eigen::Vector2d uv;
    const Slot* at = looking_at(p_c, in_camera, uv);
    if (at == nullptr || !at->camera->project(in_camera, seen)) return false;
    seen.uv = uv;
    seen.J = Eigen::Matrix<double, 2, 3>(seen.J * at->R_cb);
    return true;
  }
  if (!flat_) return std::visit([&](const auto& lens) { return lens.project(p_c, seen); }, lens_);
  return lens_models::PinholeLens{pinhole()}.project(p_c, seen);
}

Eigen::Vector2f Camera::from_image(const Eigen::Vector2f& raw) const {
  if (!distorts_) return raw;
  if (rig_) {
    const Slot& at = slot(raw.x());
    const Eigen::Vector2f column(static_cast<float>(at.column), 0);
    return at.camera->from_image(raw - column) + column;
  }
  const auto& lens = std::get<lens_models::PlaneDistortionLens>(lens_);
  Eigen::Vector2d straight;
  if (!lens.distortion.undistort(pinhole().to_plane(raw.cast<double>()), straight)) return raw;
  return pinhole().to_pixel(straight).cast<float>();
}

bool Camera::shows(const Eigen::Vector2d& raw) const {
  if (rig_) return slot(raw.x()).camera->shows({raw.x() - slot(raw.x()).column, raw.y()});
  Eigen::Vector3d ray;
  return std::visit([&](const auto& lens) { return lens.unproject(raw, ray); }, lens_);
}

Eigen::Vector2d Camera::to_image(const Eigen::Vector2d& uv) const {
  if (!distorts_) return uv;
  if (rig_) {
    const Eigen::Vector2d column(slot(uv.x()).column, 0);
    return slot(uv.x()).camera->to_image(uv - column) + column;
  }
  const auto& lens = std::get<lens_models::PlaneDistortionLens>(lens_);
  Bent bent;
  if (!lens.distortion.distort(pinhole().to_plane(uv), bent)) {
    return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  }
  return pinhole().to_pixel(bent.at);
}

}  // namespace orbslam
