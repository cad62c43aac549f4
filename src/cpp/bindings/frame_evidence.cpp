// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <tuple>

#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "frame/inlier_spread.hpp"
#include "frame/match_error.hpp"
#include "frame/rotation_alignment.hpp"
#include "frame/velocity.hpp"

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
      "Rotation of the camera between two frames, from their small images alone: ImageRotation, or "
      "None if the images are missing or have no contrast.");
}

void bind_inliers(py::module_& module) {
  // A tuple: tracking reads all of it in each image.
  module.def(
      "pose_evidence",
      [](const TrackedFrame& frame) {
        InlierSpread spread;
        double match_error = 0;
        {
          const py::gil_scoped_release release;
          spread = spread_of_inliers(frame);
          match_error = median_match_error(frame);
        }
        return std::make_tuple(spread.cells, spread.octaves, match_error, spread.covariance);
      },
      py::arg("frame"),
      "Evidence of a frame's matches for its pose: (cells, octaves, match error, covariance).\n\n"
      "How many of 48 cells of the image hold an inlier, and how many octaves of depth. The\n"
      "median distance between matched keypoints, outliers too, and the projections of their\n"
      "points, in standard deviations of the keypoints' levels; 0 without any. The (6, 6)\n"
      "cluster-robust covariance of the pose, rotation [rad] and translation; zero where it is\n"
      "not determined. Raises StateError without a pose.");
  module.def("count_staying", &count_staying, py::arg("frame"), py::arg("T_nw"),
             py::call_guard<py::gil_scoped_release>(),
             "Number of inliers of a frame that are in the image of a camera at `T_nw`.");
  module.def("median_displacement", &median_displacement, py::arg("frame"), py::arg("T_nw"),
             py::call_guard<py::gil_scoped_release>(),
             "Median distance [px] between the projections of a frame's inliers and those into a\n"
             "camera at `T_nw`; 0 without any. Raises StateError without a pose.");
}

void bind_velocity(py::module_& module) {
  py::class_<Velocity>(module, "Velocity",
                       "A velocity, constant in the axes of the camera: the motion over an "
                       "interval.")
      .def(py::init([](const Pose& step, double seconds) {
             return Velocity{step, seconds};
           }),
           py::arg("step"), py::arg("seconds"))
      .def_readonly("step", &Velocity::step, "Motion over the interval, `T_cl`.")
      .def_readonly("seconds", &Velocity::seconds,
                    "The interval; negative where frames are tracked backwards in time.")
      .def("over", &Velocity::over, py::arg("seconds"),
           "The motion over another interval [s]; over more than a second, that over a second.")
      .def("scaled", &Velocity::scaled, py::arg("factor"),
           "The velocity after lengths have been multiplied by a factor.");
  module.def("velocity_between", &velocity_between, py::arg("last"), py::arg("frame"),
             py::arg("consecutive") = false,
             "The Velocity between two frames; None without a pose of either. With `consecutive`\n"
             "None unless the second is the next image and no loop has been closed between them.");
  module.def(
      "predict_pose", &predict_pose, py::arg("frame"), py::arg("last"),
      py::arg("velocity").none(true) = py::none(),
      "Set the pose of a frame by constant velocity; without one, to that of the last frame.\n"
      "Raises StateError when the last frame has no pose.");
}

void bind_innovation(py::module_& module) {
  module.def(
      "change_from_prediction",
      [](const TrackedFrame& frame, const TrackedFrame& last, const Velocity* velocity) {
        const PoseChange change = change_from_prediction(frame, last, velocity);
        return std::make_tuple(change.turn, change.move);
      },
      py::arg("frame"), py::arg("last"), py::arg("velocity").none(true) = py::none(),
      "(angle [rad], distance of the centres) between the pose of a frame and the predicted one;\n"
      "zero without a pose of either frame, or without a velocity.");
  module.def(
      "stated_covariance",
      [](const Matrix6d& covariance, double factor, const TrackedFrame& frame,
         const TrackedFrame& last, const Velocity* velocity, const Pose* map_motion,
         double wrong_share) {
        return stated_covariance(covariance, factor, frame, last,
                                 {velocity, map_motion, wrong_share});
      },
      py::arg("covariance"), py::arg("factor"), py::arg("frame"), py::arg("last"),
      py::arg("velocity").none(true) = py::none(), py::arg("map_motion").none(true) = py::none(),
      py::arg("wrong_share") = 0.0,
      "`factor` times a covariance (6, 6), plus that of the motion of the map under the last "
      "frame\n"
      "since it was tracked, and `wrong_share` times that of the innovation.");
  module.def(
      "count_staying_after", &count_staying_after, py::arg("frame"), py::arg("velocity"),
      py::arg("n_intervals"), py::call_guard<py::gil_scoped_release>(),
      "Number of inliers of a frame that are still in its image after a number of intervals of a\n"
      "velocity. Raises StateError without a pose.");
}

}  // namespace

void bind_frame_evidence(py::module_& module) {
  bind_rotation(module);
  bind_inliers(module);
  bind_velocity(module);
  bind_innovation(module);
}

}  // namespace orbslam::bindings
