// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "base/worker_thread.hpp"
#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "geometry/pnp_ransac.hpp"
#include "geometry/triangulation.hpp"
#include "geometry/two_view.hpp"

namespace orbslam::bindings {
namespace {

using namespace py::literals;
using FloatArray = py::array_t<float, py::array::c_style | py::array::forcecast>;
using DoubleArray = py::array_t<double, py::array::c_style | py::array::forcecast>;
using IntArray = py::array_t<int, py::array::c_style | py::array::forcecast>;

py::array_t<bool> flags(const std::vector<std::uint8_t>& values) {
  return copy_to_array<bool>(values.data(), {static_cast<py::ssize_t>(values.size())});
}

void require_columns(const py::array& array, py::ssize_t columns, const char* what) {
  if (array.ndim() != 2 || array.shape(1) != columns) {
    throw py::value_error(std::string(what) + " must have the shape (n, " +
                          std::to_string(columns) + ")");
  }
}

std::vector<Eigen::Vector2f> pixels_of(const FloatArray& array, const char* what) {
  require_columns(array, 2, what);
  std::vector<Eigen::Vector2f> pixels;
  pixels.reserve(static_cast<std::size_t>(array.shape(0)));
  for (py::ssize_t i = 0; i < array.shape(0); ++i)
    pixels.emplace_back(array.at(i, 0), array.at(i, 1));
  return pixels;
}

TwoViewResult reconstruct(const FloatArray& initial, const FloatArray& current,
                          const IntArray& matches, const Pinhole& pinhole, std::uint64_t seed,
                          WorkerThread* helper) {
  const auto first = pixels_of(initial, "initial"), second = pixels_of(current, "current");
  if (matches.ndim() != 1) throw py::value_error("matches must be a 1-D array");
  const std::vector<int> partners(matches.data(), matches.data() + matches.size());
  const py::gil_scoped_release release;
  return reconstruct_two_views({first, second, partners, pinhole}, TwoViewOptions(), seed, helper);
}

void bind_two_view(py::module_& module) {
  py::class_<WorkerThread>(module, "WorkerThread", "A helper thread that waits for work.")
      .def(py::init<>());
  py::enum_<TwoViewOutcome>(module, "TwoViewOutcome", "A reconstruction, or why there is none.")
      .value("reconstructed", TwoViewOutcome::reconstructed)
      .value("too_few_matches", TwoViewOutcome::too_few_matches)
      .value("degenerate_points", TwoViewOutcome::degenerate_points)
      .value("no_model", TwoViewOutcome::no_model)
      .value("degenerate_plane", TwoViewOutcome::degenerate_plane)
      .value("too_few_points", TwoViewOutcome::too_few_points)
      .value("low_parallax", TwoViewOutcome::low_parallax)
      .value("ambiguous_motion", TwoViewOutcome::ambiguous_motion);
  py::class_<TwoViewResult>(module, "TwoViewResult", "Motion and points of two views.")
      .def_property_readonly("success", &TwoViewResult::success)
      .def_readonly("outcome", &TwoViewResult::outcome)
      .def_readonly("n_matches", &TwoViewResult::n_matches)
      .def_readonly("homography_score", &TwoViewResult::homography_score)
      .def_readonly("fundamental_score", &TwoViewResult::fundamental_score)
      .def_readonly("homography_ratio", &TwoViewResult::homography_ratio,
                    "Share of the homography in both scores; above 0.40 it is chosen.")
      .def_readonly("T_21", &TwoViewResult::T_21, "First to second camera, |translation| = 1.")
      .def_readonly("parallax", &TwoViewResult::parallax, "Degrees.")
      .def_property_readonly(
          "points",
          [](const TwoViewResult& r) {
            return copy_to_array<double>(r.points.data(),
                                         {static_cast<py::ssize_t>(r.points.size()), 3});
          },
          "(n, 3) float64 per initial keypoint, in the first camera.")
      .def_property_readonly(
          "triangulated", [](const TwoViewResult& r) { return flags(r.triangulated); },
          "(n,) bool: the point is well placed.");
  module.def(
      "reconstruct_two_views", &reconstruct, "initial"_a, "current"_a, "matches"_a, "pinhole"_a,
      "seed"_a = 0, "helper"_a = py::none(),
      "Structure from two views: homography and fundamental matrix side by side, the\n"
      "better one gives the motion. `initial` (n, 2), `current` (m, 2): undistorted pixels;\n"
      "`matches` (n,): index in current or -1. `helper`: a WorkerThread for the second\n"
      "model; the result is the same without.");
}

PnpProblem problem_of(const DoubleArray& points, const DoubleArray& pixels,
                      const DoubleArray& sigma2, const Pinhole& pinhole) {
  require_columns(points, 3, "points");
  require_columns(pixels, 2, "pixels");
  if (sigma2.ndim() != 1) throw py::value_error("sigma2 must be a 1-D array");
  PnpProblem problem;
  problem.points = Eigen::Map<const Eigen::Matrix3Xd>(points.data(), 3, points.shape(0));
  problem.pixels = Eigen::Map<const Eigen::Matrix2Xd>(pixels.data(), 2, pixels.shape(0));
  problem.sigma2 = Eigen::Map<const Eigen::VectorXd>(sigma2.data(), sigma2.size());
  problem.pinhole = pinhole;
  return problem;
}

void bind_pnp(py::module_& module) {
  py::class_<PnpPose>(module, "PnpPose", "A pose from points and pixels.")
      .def_readonly("T_cw", &PnpPose::T_cw)
      .def_property_readonly(
          "inliers", [](const PnpPose& pose) { return flags(pose.inliers); }, "(n,) bool.")
      .def_readonly("n_inliers", &PnpPose::n_inliers)
      .def_readonly("refined", &PnpPose::refined, "Estimated from all inliers of a sample's pose.");
  py::class_<PnpRansac>(module, "PnpRansac",
                        "RANSAC over EPnP in slices, so that candidates can take turns.")
      .def(py::init([](const DoubleArray& points, const DoubleArray& pixels,
                       const DoubleArray& sigma2, const Pinhole& pinhole, std::uint64_t seed) {
             return PnpRansac(problem_of(points, pixels, sigma2, pinhole), PnpOptions(), seed);
           }),
           "points"_a, "pixels"_a, "sigma2"_a, "pinhole"_a, "seed"_a = 0,
           "`points` (n, 3) world, `pixels` (n, 2) undistorted, `sigma2` (n,) [pixels^2].")
      .def("iterate", &PnpRansac::iterate, "n"_a, py::call_guard<py::gil_scoped_release>(),
           "Runs at most n further iterations; a PnpPose, or None.")
      .def_property_readonly("exhausted", &PnpRansac::exhausted, "No iterations are left.")
      .def_property_readonly("iterations", &PnpRansac::iterations)
      .def_property_readonly("max_iterations", &PnpRansac::max_iterations)
      .def_property_readonly("min_inliers", &PnpRansac::min_inliers);
}

}  // namespace

void bind_geometry(py::module_& module) {
  module.def("triangulate", &triangulate, "ray_1"_a, "ray_2"_a, "T_1w"_a, "T_2w"_a,
             "Linear triangulation of two normalised rays (3,) with z = 1, each in its camera's\n"
             "frame. Returns the world point (3,) of least algebraic error, or None when it lies\n"
             "at infinity. It may lie behind a camera: check the depths.");
  module.def("fundamental_matrix", &fundamental_matrix, "T_1w"_a, "T_2w"_a, "K_1"_a, "K_2"_a,
             "The (3, 3) matrix F_12 with x_1^T F_12 x_2 = 0 for pixels (u, v, 1) of cameras with\n"
             "calibration matrices K_1 and K_2.");
  bind_two_view(module);
  bind_pnp(module);
}

}  // namespace orbslam::bindings
