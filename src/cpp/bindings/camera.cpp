// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera.hpp"

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <utility>

#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"

namespace orbslam::bindings {
namespace {

py::array_t<float> undistort(const Camera& camera,
                             const py::array_t<float, py::array::c_style>& points) {
  if (points.ndim() != 2 || points.shape(1) != 2) {
    throw py::value_error("points must have the shape (n, 2)");
  }
  std::vector<float> xy(points.data(), points.data() + points.size());
  {
    const py::gil_scoped_release release;
    camera.lens().undistort(camera.pinhole(), xy);
  }
  return copy_to_array<float>(xy.data(), {points.shape(0), 2});
}

// Sizes are (width, height) in Python.
using SizePair = std::pair<int, int>;

SizePair to_pair(const ImageSize& size) { return {size.width, size.height}; }

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

}  // namespace

void bind_camera(py::module_& module) {
  bind_pinhole(module);

  py::class_<CameraOptions>(module, "CameraOptions", "What a Camera is made from.")
      .def(py::init([](const Pinhole& pinhole, const SizePair& image_size,
                       const std::array<double, 5>& distortion, double bf, double depth_ratio) {
             return CameraOptions{pinhole, distortion, bf, depth_ratio,
                                  ImageSize{image_size.first, image_size.second}};
           }),
           py::arg("pinhole"), py::arg("image_size"),
           py::arg("distortion") = std::array<double, 5>{}, py::arg("bf") = 0.0,
           py::arg("depth_ratio") = 0.0,
           "image_size: (width, height) [px]. distortion: k1, k2, p1, p2, k3 (zeros: rectified "
           "images). bf: baseline times fx "
           "[px m], 0 for a single camera. depth_ratio: close/far limit in baselines.")
      .def_readwrite("pinhole", &CameraOptions::pinhole)
      .def_readwrite("distortion", &CameraOptions::distortion, "k1, k2, p1, p2, k3.")
      .def_readwrite("bf", &CameraOptions::bf, "Baseline times fx [px m]; 0: none.")
      .def_readwrite("depth_ratio", &CameraOptions::depth_ratio,
                     "Close/far limit in multiples of the baseline.")
      .def_property(
          "image_size", [](const CameraOptions& options) { return to_pair(options.image_size); },
          [](CameraOptions& options, const SizePair& size) {
            options.image_size = {size.first, size.second};
          },
          "(width, height) of the first image [px].");

  py::class_<Camera, std::shared_ptr<Camera>>(
      module, "Camera", "A calibrated camera: pinhole, lens, (virtual) right camera, bounds.")
      .def(py::init<const CameraOptions&>(), py::arg("options"),
           "Raises SettingsError when an option is out of range.")
      .def_property_readonly("pinhole", &Camera::pinhole)
      .def_property_readonly("bounds", &Camera::bounds)
      .def_property_readonly(
          "image_size", [](const Camera& camera) { return to_pair(camera.image_size()); },
          "(width, height) [px].")
      .def_property_readonly(
          "is_rectified", [](const Camera& camera) { return camera.lens().is_identity(); },
          "True when the lens does not distort.")
      .def_property_readonly("has_baseline", &Camera::has_baseline)
      .def_property_readonly("bf", &Camera::bf, "Baseline times fx [px m].")
      .def_property_readonly("baseline", &Camera::baseline, "Metres.")
      .def_property_readonly("close_depth", &Camera::close_depth,
                             "Depths below this [m] are trusted from one view; inf without a "
                             "baseline.")
      .def("right_column", &Camera::right_column, py::arg("u"), py::arg("z"),
           "Column in the (virtual) right image of a point at column u and depth z [m].")
      .def("undistort", &undistort, py::arg("points"),
           "Undistorted pixels (n, 2) float32 of raw pixels (n, 2).");
}

}  // namespace orbslam::bindings
