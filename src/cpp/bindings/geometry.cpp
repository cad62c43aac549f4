// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <memory>
#include <optional>
#include <string>

#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "geometry/epnp.hpp"
#include "geometry/pnp_ransac.hpp"
#include "geometry/triangulation.hpp"
#include "geometry/two_view.hpp"

namespace orbslam::bindings {
namespace {

using namespace py::literals;

std::vector<Eigen::Vector2f> positions_of(const Input<float>& array, const char* name) {
  std::vector<Eigen::Vector2f> positions(rows_of(array, 2, name));
  for (std::size_t i = 0; i < positions.size(); ++i) {
    positions[i] = {array.data()[2 * i], array.data()[2 * i + 1]};
  }
  return positions;
}

std::vector<EightPairs> samples_of(const Input<std::int32_t>& array) {
  std::vector<EightPairs> samples(rows_of(array, 8, "samples"));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    std::copy_n(array.data() + 8 * i, 8, samples[i].begin());
  }
  return samples;
}

void bind_two_view_types(py::module_& module) {
  py::enum_<TwoViewOutcome>(module, "TwoViewOutcome",
                            "Whether two views gave a reconstruction, or why not.")
      .value("reconstructed", TwoViewOutcome::reconstructed)
      .value("too_few_matches", TwoViewOutcome::too_few_matches)
      .value("degenerate_points", TwoViewOutcome::degenerate_points)
      .value("no_model", TwoViewOutcome::no_model)
      .value("degenerate_plane", TwoViewOutcome::degenerate_plane)
      .value("too_few_points", TwoViewOutcome::too_few_points)
      .value("low_parallax", TwoViewOutcome::low_parallax)
      .value("ambiguous_motion", TwoViewOutcome::ambiguous_motion);
  py::enum_<TwoViewModel>(module, "TwoViewModel", "The model that gave the motion.")
      .value("none", TwoViewModel::none)
      .value("homography", TwoViewModel::homography)
      .value("fundamental", TwoViewModel::fundamental);
  py::class_<MotionScore>(module, "MotionScore", "Support of one motion hypothesis.")
      .def_readonly("n_good", &MotionScore::n_good, "Pairs in front of both cameras that fit.")
      .def_readonly("parallax", &MotionScore::parallax, "Degrees; of the 51st best pair.");
  py::class_<TwoViewOptions>(module, "TwoViewOptions", "Limits of reconstruct_two_views.")
      .def(py::init([](double sigma, int n_samples, std::size_t min_matches, std::size_t min_points,
                       double min_parallax) {
             return TwoViewOptions{sigma, n_samples, min_matches, {min_points, min_parallax}};
           }),
           "sigma"_a = 1.0, "n_samples"_a = 200, "min_matches"_a = 100, "min_points"_a = 50,
           "min_parallax"_a = 1.0)
      .def_readwrite("sigma", &TwoViewOptions::sigma, "Deviation of a keypoint [pixels].")
      .def_readwrite("n_samples", &TwoViewOptions::n_samples, "Minimal samples of 8 matches.")
      .def_readwrite("min_matches", &TwoViewOptions::min_matches, "Fewer are refused.")
      .def_property(
          "min_points", [](const TwoViewOptions& o) { return o.limits.min_points; },
          [](TwoViewOptions& o, std::size_t value) { o.limits.min_points = value; },
          "Least number of points that a motion must triangulate.")
      .def_property(
          "min_parallax", [](const TwoViewOptions& o) { return o.limits.min_parallax; },
          [](TwoViewOptions& o, double value) { o.limits.min_parallax = value; }, "Degrees.");
}

void bind_two_view_motion(py::module_& module) {
  using Motion = TwoViewMotion;
  py::class_<Motion>(module, "TwoViewMotion",
                     "A motion between two views, and the points that it triangulates.")
      .def_readonly("T_21", &Motion::T_21,
                    "Pose from camera 1 to camera 2, translation of length 1.")
      .def_readonly("parallax", &Motion::parallax, "Degrees.")
      .def_property_readonly(
          "points",
          [](const Motion& m) {
            return copy_to_array<double>(m.points.data(),
                                         {static_cast<py::ssize_t>(m.points.size()), 3});
          },
          "Per initial keypoint, (n, 3) float64 in the frame of camera 1; zero where missing.")
      .def_property_readonly(
          "triangulated", [](const Motion& m) { return to_array(m.triangulated); },
          "Per initial keypoint, (n,) uint8: the point is well placed.");
}

void bind_two_view_result(py::module_& module) {
  using Result = TwoViewResult;
  py::class_<Result>(module, "TwoViewResult", "Result of reconstruct_two_views.")
      .def_property_readonly("success", &Result::success, "The outcome is `reconstructed`.")
      .def_readonly("outcome", &Result::outcome, "Success or the reason of failure.")
      .def_readonly("model", &Result::model, "The model that was chosen.")
      .def_readonly("n_matches", &Result::n_matches, "Matches given.")
      .def_readonly("homography_score", &Result::homography_score, "0: no homography.")
      .def_readonly("fundamental_score", &Result::fundamental_score, "0: no fundamental matrix.")
      .def_readonly("homography_ratio", &Result::homography_ratio,
                    "Of the homography's score in the sum; it is chosen above 0.40.")
      .def_readonly("H_21", &Result::H_21, "(3, 3) float64, pixels of view 1 to view 2.")
      .def_readonly("F_21", &Result::F_21, "(3, 3) float64, x_2^T F_21 x_1 = 0 for pixels.")
      .def_readonly("n_homography_inliers", &Result::n_homography_inliers, "Matches that fit H.")
      .def_readonly("n_fundamental_inliers", &Result::n_fundamental_inliers, "Matches that fit F.")
      .def_readonly("hypotheses", &Result::hypotheses, "MotionScore of each motion tried.")
      .def_readonly("alternatives", &Result::alternatives,
                    "If the motion is ambiguous: a TwoViewMotion for each possible motion. Further "
                    "views decide.")
      .def_readonly("best_hypothesis", &Result::best_hypothesis, "Index of the best one.")
      .def_readonly("T_21", &Result::T_21,
                    "Pose from camera 1 to camera 2, translation of length 1.")
      .def_readonly("parallax", &Result::parallax, "Of the best hypothesis, degrees.")
      .def_property_readonly(
          "points",
          [](const Result& r) {
            return copy_to_array<double>(r.points.data(),
                                         {static_cast<py::ssize_t>(r.points.size()), 3});
          },
          "Per initial keypoint, (n, 3) float64 in the frame of camera 1; zero where missing.")
      .def_property_readonly(
          "triangulated", [](const Result& r) { return to_array(r.triangulated); },
          "Per initial keypoint, (n,) uint8: the point is well placed.")
      .def_property_readonly(
          "homography_inlier", [](const Result& r) { return to_array(r.homography_inlier); },
          "Per initial keypoint, (n,) uint8.")
      .def_property_readonly(
          "fundamental_inlier", [](const Result& r) { return to_array(r.fundamental_inlier); },
          "Per initial keypoint, (n,) uint8.");
}

void bind_two_view(py::module_& module) {
  bind_two_view_types(module);
  bind_two_view_motion(module);
  bind_two_view_result(module);
  module.def(
      "reconstruct_two_views",
      [](const Input<float>& initial, const Input<float>& current,
         const Input<std::int32_t>& matches, const Camera& camera, std::uint64_t seed,
         const TwoViewOptions& options, const std::optional<Input<std::int32_t>>& samples,
         bool two_threads) {
        if (matches.ndim() != 1) throw py::value_error("matches must have the shape (n,)");
        const auto points_1 = positions_of(initial, "initial");
        const auto points_2 = positions_of(current, "current");
        const std::vector<int> indices(matches.data(), matches.data() + matches.size());
        std::optional<std::vector<EightPairs>> given;
        if (samples) given = samples_of(*samples);
        const TwoViewInput input{points_1, points_2, indices, camera};
        const py::gil_scoped_release release;
        const auto helper = two_threads ? std::make_unique<WorkerThread>() : nullptr;
        return given ? reconstruct_two_views(input, options, *given, helper.get())
                     : reconstruct_two_views(input, options, seed, helper.get());
      },
      "initial"_a, "current"_a, "matches"_a, "camera"_a, "seed"_a = 0,
      py::arg_v("options", TwoViewOptions(), "TwoViewOptions()"), "samples"_a = py::none(),
      "two_threads"_a = true,
      "Motion and points from two views, up to scale.\n\n"
      "`initial`, `current`: (n, 2), (m, 2) float32 undistorted pixels of all keypoints.\n"
      "`matches`: (n,) int32 index in `current` or -1. `camera`: a Camera.\n"
      "`samples`: (k, 8) int32 indices into the matches, ascending by initial keypoint, instead\n"
      "of those drawn from `seed`. `two_threads` does not change the result. Raises ValueError\n"
      "for bad shapes, indices or options.");
}

void bind_place_points(py::module_& module) {
  module.def(
      "place_points",
      [](const Input<float>& initial, const Input<float>& current,
         const Input<std::int32_t>& matches, const Camera& camera, const Pose& T_21, double sigma) {
        if (matches.ndim() != 1) throw py::value_error("matches must have the shape (n,)");
        const auto points_1 = positions_of(initial, "initial");
        const auto points_2 = positions_of(current, "current");
        const std::vector<int> indices(matches.data(), matches.data() + matches.size());
        const TwoViewInput input{points_1, points_2, indices, camera};
        const py::gil_scoped_release release;
        return place_points(input, T_21, sigma);
      },
      "initial"_a, "current"_a, "matches"_a, "camera"_a, "T_21"_a, "sigma"_a = 1.0,
      "Triangulate all matches that agree with a known motion, by the rules of\n"
      "reconstruct_two_views. Returns a TwoViewMotion. `T_21`: Pose, camera 1 to camera 2; the "
      "length of\n"
      "its translation becomes 1. The others as there. Raises ValueError for bad shapes or\n"
      "indices, and for a translation of 0.");
}

PnpProblem pnp_problem(const Input<double>& points, const Input<double>& pixels,
                       const Input<double>& sigma2, const std::shared_ptr<const Camera>& camera) {
  const auto n = static_cast<Eigen::Index>(rows_of(points, 3, "points"));
  const auto n_pixels = static_cast<Eigen::Index>(rows_of(pixels, 2, "pixels"));
  if (sigma2.ndim() != 1) throw py::value_error("sigma2 must have the shape (n,)");
  PnpProblem problem;
  // Rows of NumPy's are columns of Eigen's.
  problem.points = Eigen::Map<const Eigen::Matrix3Xd>(points.data(), 3, n);
  problem.pixels = Eigen::Map<const Eigen::Matrix2Xd>(pixels.data(), 2, n_pixels);
  problem.sigma2 = Eigen::Map<const Eigen::VectorXd>(sigma2.data(), sigma2.size());
  problem.camera = camera;
  return problem;
}

void bind_epnp(py::module_& module) {
  py::class_<EpnpPose>(module, "EpnpPose", "Result of solve_epnp.")
      .def_readonly("T_cw", &EpnpPose::T_cw, "World to camera.")
      .def_readonly("mean_error", &EpnpPose::mean_error, "Mean reprojection error [pixels].");
  module.def(
      "solve_epnp",
      [](const Input<double>& points, const Input<double>& pixels, const Camera& camera) {
        const auto n = static_cast<Eigen::Index>(rows_of(points, 3, "points"));
        const auto n_pixels = static_cast<Eigen::Index>(rows_of(pixels, 2, "pixels"));
        const Eigen::Map<const Eigen::Matrix3Xd> world(points.data(), 3, n);
        const Eigen::Map<const Eigen::Matrix2Xd> image(pixels.data(), 2, n_pixels);
        const py::gil_scoped_release release;
        return solve_epnp(world, image, camera);
      },
      "points"_a, "pixels"_a, "camera"_a,
      "Pose from (n, 3) float64 world points and (n, 2) float64 undistorted pixels, n >= 4.\n\n"
      "`camera`: a Camera. Returns an EpnpPose, or None for collinear points.\n"
      "All points count as inliers. Raises ValueError for bad shapes.");
}

void bind_pnp_ransac(py::module_& module) {
  py::class_<PnpOptions>(module, "PnpOptions", "Options of PnpRansac.")
      .def(py::init([](double probability, std::size_t min_inliers, double inlier_ratio,
                       int max_iterations, int exponent, double max_chi2) {
             return PnpOptions{{probability, min_inliers, inlier_ratio, max_iterations, exponent},
                               max_chi2};
           }),
           "probability"_a = 0.99, "min_inliers"_a = kPnpMinInliers, "inlier_ratio"_a = 0.5,
           "max_iterations"_a = 300, "exponent"_a = 3, "max_chi2"_a = 5.991,
           "`exponent`: sample size in the count of iterations. `max_chi2`: limit of the squared\n"
           "error over the variance.");
  py::class_<PnpPose>(module, "PnpPose", "A pose found by PnpRansac.")
      .def_readonly("T_cw", &PnpPose::T_cw, "World to camera.")
      .def_property_readonly(
          "inliers", [](const PnpPose& p) { return to_array(p.inliers); },
          "Per correspondence, (n,) uint8.")
      .def_readonly("n_inliers", &PnpPose::n_inliers, "Number of inliers.")
      .def_readonly("refined", &PnpPose::refined, "Estimated from all inliers of a sample's pose.");
  py::class_<PnpRansac>(module, "PnpRansac",
                        "RANSAC over EPnP in slices, so that several candidates can take turns.")
      .def(py::init([](const Input<double>& points, const Input<double>& pixels,
                       const Input<double>& sigma2, const std::shared_ptr<Camera>& camera,
                       std::uint64_t seed, const PnpOptions& options) {
             return std::make_unique<PnpRansac>(pnp_problem(points, pixels, sigma2, camera),
                                                options, seed);
           }),
           "points"_a, "pixels"_a, "sigma2"_a, "camera"_a.none(false), "seed"_a = 0,
           py::arg_v("options", PnpOptions(), "PnpOptions()"),
           "`points`: (n, 3) float64 world. `pixels`: (n, 2) float64 undistorted. `sigma2`: (n,)\n"
           "[pixels^2]. `camera`: a Camera. Raises ValueError for bad shapes or options.")
      .def("iterate", &PnpRansac::iterate, "n"_a, py::call_guard<py::gil_scoped_release>(),
           "At most n further iterations. Returns a PnpPose as soon as one is good enough, the\n"
           "best one when the iterations are used up, or None.")
      .def_property_readonly("exhausted", &PnpRansac::exhausted, "No iterations are left.")
      .def_property_readonly("iterations", &PnpRansac::iterations, "Done so far.")
      .def_property_readonly("max_iterations", &PnpRansac::max_iterations, "Of all calls.")
      .def_property_readonly("min_inliers", &PnpRansac::min_inliers, "A pose needs as many.");
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
  bind_place_points(module);
  bind_epnp(module);
  bind_pnp_ransac(module);
}

}  // namespace orbslam::bindings
