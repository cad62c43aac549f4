// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera.hpp"

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"

namespace orbslam::bindings {
namespace {

using Matrix2Xf = Eigen::Matrix<float, 2, Eigen::Dynamic>;

template <class Item>
using Rows = py::array_t<Item, py::array::c_style>;

void check_columns(const py::array& points, py::ssize_t width, const char* name) {
  if (points.ndim() != 2 || points.shape(1) != width) {
    throw py::value_error(std::string(name) + " must have the shape (n, " + std::to_string(width) +
                          ")");
  }
}

py::array_t<float> from_image(const Camera& camera, const Rows<float>& raw) {
  check_columns(raw, 2, "raw");
  Matrix2Xf pixels = Eigen::Map<const Matrix2Xf>(raw.data(), 2, raw.shape(0));
  {
    const py::gil_scoped_release release;
    for (Eigen::Index i = 0; i < pixels.cols(); ++i)
      pixels.col(i) = camera.from_image(pixels.col(i));
  }
  return copy_to_array<float>(pixels.data(), {raw.shape(0), 2});
}

py::array_t<double> to_image(const Camera& camera, const Rows<double>& pixels) {
  check_columns(pixels, 2, "pixels");
  Eigen::Matrix2Xd raw = Eigen::Map<const Eigen::Matrix2Xd>(pixels.data(), 2, pixels.shape(0));
  for (Eigen::Index i = 0; i < raw.cols(); ++i) raw.col(i) = camera.to_image(raw.col(i));
  return copy_to_array<double>(raw.data(), {pixels.shape(0), 2});
}

py::array_t<double> project(const Camera& camera, const Rows<double>& points) {
  check_columns(points, 3, "points");
  Eigen::Matrix2Xd pixels =
      Eigen::Matrix2Xd::Constant(2, points.shape(0), std::numeric_limits<double>::quiet_NaN());
  const Eigen::Map<const Eigen::Matrix3Xd> p_c(points.data(), 3, points.shape(0));
  for (Eigen::Index i = 0; i < pixels.cols(); ++i) {
    Eigen::Vector2d uv;
    if (camera.project(p_c.col(i), uv)) pixels.col(i) = uv;
  }
  return copy_to_array<double>(pixels.data(), {points.shape(0), 2});
}

py::array_t<double> errors(const Camera& camera, const Rows<double>& points,
                           const Rows<double>& pixels) {
  check_columns(points, 3, "points");
  check_columns(pixels, 2, "pixels");
  if (points.shape(0) != pixels.shape(0)) {
    throw py::value_error("points and pixels must have the same length");
  }
  Eigen::Matrix2Xd all =
      Eigen::Matrix2Xd::Constant(2, points.shape(0), std::numeric_limits<double>::quiet_NaN());
  const Eigen::Map<const Eigen::Matrix3Xd> p_c(points.data(), 3, points.shape(0));
  const Eigen::Map<const Eigen::Matrix2Xd> uv(pixels.data(), 2, pixels.shape(0));
  for (Eigen::Index i = 0; i < all.cols(); ++i) {
    Eigen::Vector2d error;
    if (camera.error(p_c.col(i), uv(0, i), uv(1, i), error)) all.col(i) = error;
  }
  return copy_to_array<double>(all.data(), {points.shape(0), 2});
}

py::array_t<double> rays(const Camera& camera, const Rows<double>& pixels) {
  check_columns(pixels, 2, "pixels");
  const Eigen::Map<const Eigen::Matrix2Xd> uv(pixels.data(), 2, pixels.shape(0));
  Eigen::Matrix3Xd directions(3, uv.cols());
  for (Eigen::Index i = 0; i < uv.cols(); ++i) {
    directions.col(i) = camera.ray(uv(0, i), uv(1, i));
  }
  return copy_to_array<double>(directions.data(), {pixels.shape(0), 3});
}

void bind_pinhole(py::module_& module) {
  py::class_<Pinhole>(module, "Pinhole", "Pinhole intrinsics in pixels.")
      .def(py::init([](double fx, double fy, double cx, double cy) {
             return Pinhole{fx, fy, cx, cy};
           }),
           py::arg("fx"), py::arg("fy"), py::arg("cx"), py::arg("cy"))
      .def_readonly("fx", &Pinhole::fx, "Horizontal focal length [px].")
      .def_readonly("fy", &Pinhole::fy, "Vertical focal length [px].")
      .def_readonly("cx", &Pinhole::cx, "Principal point, column [px].")
      .def_readonly("cy", &Pinhole::cy, "Principal point, row [px].");

  py::class_<ImageBounds>(module, "ImageBounds", "Limits of undistorted pixel coordinates.")
      .def_readonly("min_x", &ImageBounds::min_x)
      .def_readonly("max_x", &ImageBounds::max_x)
      .def_readonly("min_y", &ImageBounds::min_y)
      .def_readonly("max_y", &ImageBounds::max_y);
}

Camera rig_of(const std::vector<std::shared_ptr<Camera>>& cameras, const std::vector<Pose>& T_bc,
              const std::vector<bool>& active) {
  if (T_bc.size() != cameras.size() || active.size() != cameras.size()) {
    throw py::value_error("give as many poses and flags as cameras");
  }
  CameraOptions options;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    options.members.push_back({cameras[i], T_bc[i], active[i]});
  }
  return Camera(options);
}

// Pinhole and size lie flat in Python: options.fx, options.width.
template <class Part, class Value>
void flat_property(py::class_<CameraOptions>& options, const char* name, Part CameraOptions::*part,
                   Value Part::*value, const char* doc) {
  options.def_property(
      name, [=](const CameraOptions& o) { return o.*part.*value; },
      [=](CameraOptions& o, Value v) { o.*part.*value = v; }, doc);
}

// 4, 5 or 8 coefficients in OpenCV's order; those that are not given are 0.
Distortion distortion_of(const std::vector<double>& coefficients) {
  Distortion distortion{};
  if (coefficients.size() > distortion.size()) {
    throw py::value_error("distortion has at most 8 coefficients, got " +
                          std::to_string(coefficients.size()));
  }
  std::copy(coefficients.begin(), coefficients.end(), distortion.begin());
  return distortion;
}

void bind_camera_options(py::module_& module) {
  py::class_<CameraOptions> options(module, "CameraOptions", "What a Camera is made from.");
  options
      .def(py::init([](double fx, double fy, double cx, double cy, int width, int height,
                       const std::vector<double>& distortion, double bf, double depth_ratio,
                       const std::shared_ptr<CameraModel>& model,
                       const Eigen::Vector3d& right_centre) {
             const Distortion lens = distortion_of(distortion);
             return CameraOptions{{fx, fy, cx, cy}, lens,  bf,           depth_ratio,
                                  {width, height},  model, right_centre, {}};
           }),
           py::arg("fx") = 0.0, py::arg("fy") = 0.0, py::arg("cx") = 0.0, py::arg("cy") = 0.0,
           py::arg("width") = 0, py::arg("height") = 0,
           py::arg("distortion") = std::vector<double>{}, py::arg("bf") = 0.0,
           py::arg("depth_ratio") = 0.0, py::arg("model") = nullptr,
           py::arg("right_centre") = Eigen::Vector3d(Eigen::Vector3d::Zero()),
           "`model`: a CameraModel in place of fx, fy, cx, cy and distortion. `right_centre`: of\n"
           "the right camera of a fisheye pair, in this camera's frame [m], in place of bf. "
           "Nothing\n"
           "is checked before a Camera is made.")
      .def_property(
          "distortion", [](const CameraOptions& o) { return o.distortion; },
          [](CameraOptions& o, const std::vector<double>& d) { o.distortion = distortion_of(d); },
          "k1, k2, p1, p2[, k3[, k4, k5, k6]]; zeros for rectified images.")
      .def_readwrite("bf", &CameraOptions::bf, "Baseline times fx [px m]; 0: single camera.")
      .def_readwrite("depth_ratio", &CameraOptions::depth_ratio,
                     "Close/far limit in multiples of the baseline.");
  flat_property(options, "fx", &CameraOptions::pinhole, &Pinhole::fx, "Focal length [px].");
  flat_property(options, "fy", &CameraOptions::pinhole, &Pinhole::fy, "Focal length [px].");
  flat_property(options, "cx", &CameraOptions::pinhole, &Pinhole::cx, "Principal point [px].");
  flat_property(options, "cy", &CameraOptions::pinhole, &Pinhole::cy, "Principal point [px].");
  flat_property(options, "width", &CameraOptions::image_size, &ImageSize::width,
                "Width of the first image [px].");
  flat_property(options, "height", &CameraOptions::image_size, &ImageSize::height,
                "Height of the first image [px].");
}

}  // namespace

void bind_camera(py::module_& module) {
  bind_pinhole(module);

  bind_camera_options(module);

  py::class_<Camera, std::shared_ptr<Camera>>(
      module, "Camera",
      "A calibrated camera, which owns its image plane: projection, lens, bounds and (virtual)\n"
      "right camera. Of a pinhole the plane is flat, without the distortion of the lens; of a\n"
      "fisheye lens it is the image itself. Pixels of the image are called raw.")
      .def(py::init<const CameraOptions&>(), py::arg("options"),
           "Raises SettingsError when an option is out of range.")
      .def_static("rig", &rig_of, py::arg("cameras"), py::arg("T_bc"), py::arg("active"),
                  "A rig of two to eight cameras; T_bc: each camera to body coordinates [m], "
                  "active:\nwhether points are looked for in its image. Raises SettingsError.")
      .def("with_active", &Camera::with_active, py::arg("active"),
           "The same rig, where other cameras are active.")
      .def_property_readonly("is_rig", &Camera::is_rig, "Several cameras.")
      .def_property_readonly("n_cameras", &Camera::n_cameras, "Of a rig; 1 otherwise.")
      .def("camera_at", &Camera::camera_at, py::arg("u"),
           "Of a rig: the camera that column u of the plane belongs to; 0 otherwise.")
      .def("column_of", &Camera::column_of, py::arg("camera"),
           "Column of a rig's plane at which the column 0 of a camera lies.")
      .def_property_readonly("pinhole", &Camera::pinhole)
      .def_property_readonly("bounds", &Camera::bounds)
      .def_property_readonly(
          "image_size",
          [](const Camera& camera) {
            return std::pair(camera.image_size().width, camera.image_size().height);
          },
          "(width, height) [px].")
      .def_property_readonly("is_flat", &Camera::is_flat,
                             "The image plane is that of a pinhole, not of a fisheye lens.")
      .def_property_readonly(
          "is_rectified", [](const Camera& camera) { return !camera.distorts(); },
          "True when the lens does not distort.")
      .def_property_readonly("has_baseline", &Camera::has_baseline)
      .def_property_readonly("has_wide_pair", &Camera::has_wide_pair,
                             "The camera is the left one of a fisheye pair.")
      .def_property_readonly("bf", &Camera::bf, "Baseline times fx [px m].")
      .def_property_readonly("baseline", &Camera::baseline, "Metres.")
      .def_property_readonly(
          "close_depth", [](const Camera& camera) { return camera.close_depth(); },
          "Depths below this [m] are trusted from one view; inf without a "
          "baseline.")
      .def("right_column", &Camera::right_column, py::arg("u"), py::arg("z"),
           "Column in the (virtual) right image of a point at column u and depth z [m].")
      .def_property_readonly("pixels_per_radian", &Camera::pixels_per_radian,
                             "Pixels that the image moves in its middle per radian of turning.")
      .def(
          "project", &project, py::arg("points"),
          "Pixels (n, 2) float64 of the plane of points (n, 3) in the camera frame; NaN for those\n"
          "that are not visible. Bounds are not checked.")
      .def(
          "errors", &errors, py::arg("points"), py::arg("pixels"),
          "Errors (n, 2) float64 [raw px] of the projections of points (n, 3) in the camera frame\n"
          "against keypoints at pixels (n, 2) of the plane; NaN for those that are not visible.")
      .def("rays", &rays, py::arg("pixels"),
           "Directions (n, 3) float64 in which pixels (n, 2) of the plane look: points at depth 1\n"
           "in the camera frame, for a fisheye lens unit vectors; NaN where it shows nothing.")
      .def("from_image", &from_image, py::arg("raw"),
           "Pixels (n, 2) float32 of the plane of raw pixels (n, 2).")
      .def("to_image", &to_image, py::arg("pixels"),
           "Raw pixels (n, 2) float64 of pixels (n, 2) of the plane.");
}

}  // namespace orbslam::bindings
