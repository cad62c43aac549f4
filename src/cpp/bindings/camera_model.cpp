// SPDX-License-Identifier: BSD-3-Clause
#include "camera/camera_model.hpp"

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"

namespace orbslam::bindings {
namespace {

using Pixels = Eigen::Map<const Eigen::Matrix2Xd>;

py::array_t<double> project_points(const CameraModel& camera, const Input<double>& points) {
  const auto n = static_cast<py::ssize_t>(rows_of(points, 3, "points"));
  py::array_t<double> pixels({n, py::ssize_t{2}});
  const Eigen::Map<const Eigen::Matrix3Xd> p_c(points.data(), 3, n);
  Eigen::Map<Eigen::Matrix2Xd> uv(pixels.mutable_data(), 2, n);
  {
    const py::gil_scoped_release release;
    camera.project(p_c, uv);
  }
  return pixels;
}

std::pair<py::array_t<double>, py::array_t<double>> project_with_jacobian(
    const CameraModel& camera, const Input<double>& points) {
  const auto n = static_cast<py::ssize_t>(rows_of(points, 3, "points"));
  py::array_t<double> pixels({n, py::ssize_t{2}});
  const Eigen::Map<const Eigen::Matrix3Xd> p_c(points.data(), 3, n);
  Eigen::Map<Eigen::Matrix2Xd> uv(pixels.mutable_data(), 2, n);
  Eigen::Matrix<double, 6, Eigen::Dynamic> jacobians(6, n);
  {
    const py::gil_scoped_release release;
    camera.project(p_c, uv, &jacobians);
  }
  return {pixels, copy_to_array<double>(jacobians.data(), {n, 2, 3})};
}

py::array_t<double> unproject_pixels(const CameraModel& camera, const Input<double>& pixels) {
  const auto n = static_cast<py::ssize_t>(rows_of(pixels, 2, "pixels"));
  py::array_t<double> rays({n, py::ssize_t{3}});
  const Pixels uv(pixels.data(), 2, n);
  Eigen::Map<Eigen::Matrix3Xd> directions(rays.mutable_data(), 3, n);
  {
    const py::gil_scoped_release release;
    camera.unproject(uv, directions);
  }
  return rays;
}

py::array_t<double> scales_of_pixels(const CameraModel& camera, const Input<double>& pixels) {
  const auto n = static_cast<py::ssize_t>(rows_of(pixels, 2, "pixels"));
  const Pixels uv(pixels.data(), 2, n);
  Eigen::VectorXd scales;
  {
    const py::gil_scoped_release release;
    scales = camera.pixels_per_radian(uv);
  }
  return copy_to_array<double>(scales.data(), {n});
}

std::vector<std::string> names_of_parameters(const CameraModelRow& row) {
  std::vector<std::string> names;
  for (const CameraParameter& one : row.parameters) names.push_back(one.name);
  return names;
}

using NamedRow = std::tuple<std::string, std::vector<std::string>, std::vector<std::string>>;

std::vector<NamedRow> named_rows() {
  std::vector<NamedRow> rows;
  for (const CameraModelRow& row : camera_model_rows()) {
    rows.emplace_back(row.name, row.aliases, names_of_parameters(row));
  }
  return rows;
}

}  // namespace

void bind_camera_model(py::module_& module) {
  module.def("camera_models", &named_rows,
             "Name, other programs' names and parameter names of each camera model.");
  py::class_<CameraModel, std::shared_ptr<CameraModel>>(
      module, "CameraModel", "A central camera of any model, with raw pixels. Immutable.")
      .def(py::init([](const std::string& name, const std::vector<double>& parameters, int width,
                       int height) {
             return CameraModel(name, parameters, {width, height});
           }),
           py::arg("name"), py::arg("parameters"), py::arg("width"), py::arg("height"),
           "Raises SettingsError that names model, parameter and remedy.")
      .def_property_readonly("name", [](const CameraModel& camera) { return camera.row().name; })
      .def_property_readonly("parameters", &CameraModel::parameters)
      .def_property_readonly(
          "parameter_names",
          [](const CameraModel& camera) { return names_of_parameters(camera.row()); })
      .def("project", &project_points, py::arg("points"),
           "Pixels (n, 2) float64 of points (n, 3) in the camera frame; NaN outside of the domain.")
      .def("project_with_jacobian", &project_with_jacobian, py::arg("points"),
           "Pixels (n, 2) and their derivatives (n, 2, 3) by the points (n, 3), float64; NaN\n"
           "outside of the domain.")
      .def("unproject", &unproject_pixels, py::arg("pixels"),
           "Unit rays (n, 3) float64 of pixels (n, 2); NaN where the model shows nothing.")
      .def("pixels_per_radian", &scales_of_pixels, py::arg("pixels"),
           "Pixels per radian (n,) float64 at pixels (n, 2), the geometric mean over all\n"
           "directions; NaN where the model shows nothing.")
      .def(
          "angle_of_view",
          [](const CameraModel& camera) {
            const AngleOfView angles = camera.angle_of_view();
            return std::tuple(angles.horizontal, angles.vertical, angles.diagonal);
          },
          "(horizontal, vertical, diagonal) [rad].");
}

}  // namespace orbslam::bindings
