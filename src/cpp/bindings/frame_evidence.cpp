// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "bindings/bindings.hpp"
#include "frame/inlier_spread.hpp"
#include "frame/match_error.hpp"
#include "frame/rotation_alignment.hpp"

namespace orbslam::bindings {
namespace py = pybind11;
namespace {

void bind_rotation(py::module_& module) {
  py::class_<ImageRotation>(module, "ImageRotation", "Result of align_rotation().")
      .def_property_readonly(
          "quaternion_xyzw",
          [](const ImageRotation& r) { return Eigen::Vector4d(r.R_21.coeffs()); },
          "Rotation of directions of the first camera into the second, (4,) float64.")
      .def_readonly("correlation", &ImageRotation::correlation,
                    "Of the grey values where both see, -1 to 1.");
  module.def(
      "align_rotation",
      [](const Frame& first, const Frame& second) {
        const py::gil_scoped_release release;
        return align_rotation(first.small_image, second.small_image, *second.camera);
      },
      py::arg("first"), py::arg("second"),
      "How the camera turned between two frames, by their small images alone: ImageRotation, or\n"
      "None where the images are missing or say nothing.");
}

void bind_inliers(py::module_& module) {
  py::class_<InlierSpread>(module, "InlierSpread", "Result of spread_of_inliers().")
      .def_readonly("cells", &InlierSpread::cells, "Of 48 cells of the image that hold an inlier.")
      .def_readonly("octaves", &InlierSpread::octaves, "Of depth that hold an inlier.")
      .def_readonly(
          "covariance", &InlierSpread::covariance,
          "(6, 6) cluster-robust covariance of the pose: rotation [rad], translation [m].\n"
          "Zero where it is not determined.");
  module.def("spread_of_inliers", &spread_of_inliers, py::arg("frame"),
             py::call_guard<py::gil_scoped_release>(),
             "How a frame's inliers are spread over the image and over depth: InlierSpread.\n"
             "Raises StateError without a pose.");
  module.def(
      "median_match_error", &median_match_error, py::arg("frame"),
      py::call_guard<py::gil_scoped_release>(),
      "Median distance between a frame's matched keypoints, outliers too, and the projections\n"
      "of their points, in standard deviations of the keypoints' levels; 0 without any.\n"
      "Raises StateError without a pose.");
  module.def("count_staying", &count_staying, py::arg("frame"), py::arg("T_nw"),
             py::call_guard<py::gil_scoped_release>(),
             "How many inliers of a frame a camera at `T_nw` would still have in its image.");
  module.def("median_displacement", &median_displacement, py::arg("frame"), py::arg("T_nw"),
             py::call_guard<py::gil_scoped_release>(),
             "Median distance [px] between the projections of a frame's inliers and those into a\n"
             "camera at `T_nw`; 0 without any. Raises StateError without a pose.");
}

}  // namespace

void bind_frame_evidence(py::module_& module) {
  bind_rotation(module);
  bind_inliers(module);
}

}  // namespace orbslam::bindings
