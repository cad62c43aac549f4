// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <cmath>
#include <memory>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "bindings/stop_flag.hpp"
#include "map/culling.hpp"
#include "optimize/bundle_adjustment.hpp"
#include "optimize/frame_sightings.hpp"
#include "optimize/full_bundle_adjustment.hpp"
#include "optimize/local_bundle_adjustment.hpp"
#include "optimize/monocular_map.hpp"
#include "optimize/pose_optimization.hpp"

namespace orbslam::bindings {
namespace {

using namespace py::literals;

void check_rows(std::size_t rows, std::size_t wanted, const char* name) {
  if (rows == wanted) return;
  throw py::value_error(std::string(name) + " has " + std::to_string(rows) + " rows, expected " +
                        std::to_string(wanted));
}

std::vector<PoseObservation> pose_observations(const Input<double>& points,
                                               const Input<double>& pixels,
                                               const Input<double>& inverse_sigma2) {
  const std::size_t n = rows_of(points, 3, "points");
  check_rows(rows_of(pixels, 3, "pixels"), n, "pixels");
  check_rows(rows_of(inverse_sigma2, 0, "inverse_sigma2"), n, "inverse_sigma2");
  const auto X = points.unchecked<2>(), uvr = pixels.unchecked<2>();
  const auto weight = inverse_sigma2.unchecked<1>();
  std::vector<PoseObservation> observations(n);
  for (std::size_t k = 0; k < n; ++k) {
    const auto i = static_cast<py::ssize_t>(k);
    PoseObservation& o = observations[k];
    o.position = {X(i, 0), X(i, 1), X(i, 2)};
    o.u = uvr(i, 0);
    o.v = uvr(i, 1);
    o.has_depth = !std::isnan(uvr(i, 2));
    o.right_u = o.has_depth ? uvr(i, 2) : 0;
    o.inverse_sigma2 = weight(i);
  }
  return observations;
}

void bind_frame_sightings(py::module_& module) {
  using Release = py::call_guard<py::gil_scoped_release>;
  py::class_<FrameSightings>(
      module, "FrameSightings",
      "Observations of past frames, with which their poses are estimated again.")
      .def(py::init<>(), "Nothing kept.")
      .def("__len__", &FrameSightings::size)
      .def("keep", &FrameSightings::keep, "frame"_a, Release(),
           "Store the inliers of a frame, and replace those stored before.")
      .def("forget", &FrameSightings::forget, "frame"_a,
           "Drop the observations of a frame (its id).")
      .def(
          "record",
          [](FrameSightings& sightings, const Map& map, TrajectoryRecorder& recorder,
             const TrackedFrame& frame, bool lost, bool keep, std::size_t n_youngest) {
            recorder.record(map, frame, lost);
            if (keep && !lost) {
              sightings.keep(frame);
              sightings.settle(map, recorder, n_youngest);
            } else {
              sightings.forget(frame.frame->id);
            }
            return frame.anchor.map;
          },
          "map"_a, "recorder"_a, "frame"_a, "lost"_a, "keep"_a, "n_youngest"_a, Release(),
          "Record a frame, store its observations (if `keep`, and not lost), and settle all but "
          "the\n"
          "youngest frames. Returns the map of the frame.")
      .def("clear", &FrameSightings::clear, "Drop everything.")
      .def("settle", &FrameSightings::settle, "map"_a, "recorder"_a, "n_youngest"_a = 0, Release(),
           "Estimate the recorded poses of all but the youngest frames anew from the points as\n"
           "they are now, and forget those frames. Lost frames, those of living keyframes and\n"
           "those that no longer agree with half of what they saw keep their recorded pose. "
           "Returns the number of new poses.");
}

void bind_pose_optimization(py::module_& module) {
  py::class_<PoseEstimate>(module, "PoseEstimate", "Result of optimize_pose.")
      .def_readonly("T_cw", &PoseEstimate::T_cw, "World to camera.")
      .def_readonly("n_inliers", &PoseEstimate::n_inliers, "Observations that fit the pose.")
      .def_property_readonly(
          "outlier", [](const PoseEstimate& e) { return to_array(e.outlier); },
          "Per observation (n,) uint8; empty when a frame was given, which holds its own flags.")
      .def_readonly("covariance", &PoseEstimate::covariance,
                    "(6, 6) float64 of T_cw, tangent order (rotation [rad], translation), left\n"
                    "perturbation, scaled by the residual variance. Zero: nothing estimated.")
      .def_readonly("iterations", &PoseEstimate::iterations, "Of all rounds together.");

  py::class_<PosePrior>(module, "PosePrior",
                        "Gaussian of a pose: `T_cw = exp(e) mean`, with `e` (rotation [rad],\n"
                        "translation) of mean zero.")
      .def(py::init([](const Pose& mean, const Matrix6d& information) {
             return PosePrior{mean, information};
           }),
           "mean"_a, "information"_a,
           "mean: Pose `T_cw`. information: (6, 6) float64, inverse of the covariance.")
      .def_readonly("mean", &PosePrior::mean, "Pose `T_cw`.")
      .def_readonly("information", &PosePrior::information, "(6, 6) float64.");

  module.def(
      "optimize_pose",
      [](TrackedFrame& frame, const PosePrior* prior) { return optimize_pose(frame, prior); },
      "frame"_a, "prior"_a = py::none(), py::call_guard<py::gil_scoped_release>(),
      "Pose of a frame from its associated points, starting at its T_cw; writes T_cw and the\n"
      "outlier flags. Four rounds of damped least squares with a Huber kernel (off in the last);\n"
      "outliers are judged anew after each. Fewer than 3 associations: pose unchanged, no\n"
      "inliers. With a prior (PosePrior) any number is enough, and the covariance is that of both\n"
      "together. Raises StateError when the frame has no pose.");
  module.def(
      "estimate_pose",
      [](TrackedFrame& frame) {
        PoseEstimate estimate;
        std::vector<MapPointId> discarded;
        {
          const py::gil_scoped_release release;
          estimate = optimize_pose(frame);
          discarded = frame.discard_outliers();
        }
        return std::make_tuple(estimate.n_inliers, estimate.covariance, to_array(discarded));
      },
      "frame"_a,
      "optimize_pose(), then drop the outliers: (inliers, covariance (6, 6), ids (k,) int64 of "
      "the\n"
      "points that were dropped, ascending). Raises StateError without a pose.");
  module.def("pose_covariance", &pose_covariance, "frame"_a,
             py::call_guard<py::gil_scoped_release>(),
             "Covariance (6, 6) float64 of the pose that a frame has, rotation [rad] and\n"
             "translation, left perturbation, from the assumed noise of its keypoints. Outliers "
             "take no part; zero with fewer than 3 others. Raises\n"
             "StateError when the frame has no pose.");
  module.def(
      "optimize_pose",
      [](const Pose& T_cw, const Camera& camera, const Input<double>& points,
         const Input<double>& pixels, const Input<double>& inverse_sigma2) {
        const auto observations = pose_observations(points, pixels, inverse_sigma2);
        const py::gil_scoped_release release;
        return optimize_pose(T_cw, camera, observations);
      },
      "T_cw"_a, "camera"_a, "points"_a, "pixels"_a, "inverse_sigma2"_a,
      "The same from arrays.\n\n"
      "`camera`: a Camera. `points`: (n, 3) float64, world. `pixels`: (n, 3) float64, undistorted\n"
      "u, v and the right column, NaN without depth. `inverse_sigma2`: (n,) [pixels^-2]. Raises\n"
      "ValueError for bad shapes.");
}

struct BundleArrays {
  Input<std::int64_t> camera, point;
  Input<double> pixels, inverse_sigma2;
};

BundleProblem bundle_problem(const std::vector<Pose>& T_cw, const std::vector<bool>& fixed,
                             const std::shared_ptr<Camera>& model, const Input<double>& points,
                             const BundleArrays& observed) {
  check_rows(fixed.size(), T_cw.size(), "fixed");
  BundleProblem problem;
  for (std::size_t i = 0; i < T_cw.size(); ++i) {
    problem.cameras.push_back({T_cw[i], model, fixed[i]});
  }
  const std::size_t n_points = rows_of(points, 3, "points");
  const auto X = points.unchecked<2>();
  for (py::ssize_t i = 0; i < static_cast<py::ssize_t>(n_points); ++i) {
    problem.points.emplace_back(X(i, 0), X(i, 1), X(i, 2));
  }
  const std::size_t n = rows_of(observed.camera, 0, "camera_index");
  check_rows(rows_of(observed.point, 0, "point_index"), n, "point_index");
  check_rows(rows_of(observed.pixels, 3, "pixels"), n, "pixels");
  check_rows(rows_of(observed.inverse_sigma2, 0, "inverse_sigma2"), n, "inverse_sigma2");
  const auto camera = observed.camera.unchecked<1>(), point = observed.point.unchecked<1>();
  const auto uvr = observed.pixels.unchecked<2>();
  const auto weight = observed.inverse_sigma2.unchecked<1>();
  for (py::ssize_t i = 0; i < static_cast<py::ssize_t>(n); ++i) {
    const bool known = camera(i) >= 0 && camera(i) < static_cast<std::int64_t>(T_cw.size()) &&
                       point(i) >= 0 && point(i) < static_cast<std::int64_t>(n_points);
    if (!known) {
      throw py::value_error("observation " + std::to_string(i) +
                            ": camera_index or point_index out of range");
    }
    BundleProblem::Observation o;
    o.camera = static_cast<std::uint32_t>(camera(i));
    o.point = static_cast<std::uint32_t>(point(i));
    o.u = static_cast<float>(uvr(i, 0));
    o.v = static_cast<float>(uvr(i, 1));
    o.has_depth = !std::isnan(uvr(i, 2));
    o.right_u = o.has_depth ? static_cast<float>(uvr(i, 2)) : 0.0F;
    o.inverse_sigma2 = static_cast<float>(weight(i));
    problem.observations.push_back(o);
  }
  return problem;
}

py::tuple solve_bundle_arrays(const std::vector<Pose>& T_cw, const std::vector<bool>& fixed,
                              const std::shared_ptr<Camera>& model, const Input<double>& points,
                              const Input<std::int64_t>& camera_index,
                              const Input<std::int64_t>& point_index, const Input<double>& pixels,
                              const Input<double>& inverse_sigma2, const BundleOptions& options,
                              const std::shared_ptr<StopFlag>& abort) {
  BundleProblem problem = bundle_problem(T_cw, fixed, model, points,
                                         {camera_index, point_index, pixels, inverse_sigma2});
  BundleSummary summary;
  {
    const py::gil_scoped_release release;
    summary = solve_bundle(problem, options, flag_of(abort));
  }
  std::vector<Pose> poses;
  for (const auto& camera : problem.cameras) poses.push_back(camera.T_cw);
  const auto n = static_cast<py::ssize_t>(problem.points.size());
  return py::make_tuple(poses, copy_to_array<double>(problem.points.data(), {n, 3}), summary);
}

BundleSolver solver_named(const std::string& name) {
  if (name == "blocks") return BundleSolver::kBlocks;
  if (name == "ceres") return BundleSolver::kCeres;
  throw py::value_error("solver must be 'blocks' or 'ceres', not '" + name + "'");
}

std::string name_of(BundleSolver solver) {
  return solver == BundleSolver::kCeres ? "ceres" : "blocks";
}

void bind_bundle(py::module_& module) {
  py::class_<BundleOptions>(module, "BundleOptions", "How solve_bundle works.")
      .def(py::init([](int robust_iterations, int final_iterations, bool robust, int n_threads,
                       bool inverse_depth, double max_seconds, const std::string& solver) {
             return BundleOptions{robust_iterations,   final_iterations, robust,
                                  n_threads,           inverse_depth,    max_seconds,
                                  solver_named(solver)};
           }),
           "robust_iterations"_a = 5, "final_iterations"_a = 10, "robust"_a = true,
           "n_threads"_a = 1, "inverse_depth"_a = false, "max_seconds"_a = 0.0,
           "solver"_a = name_of(BundleOptions().solver))
      .def_readwrite("robust_iterations", &BundleOptions::robust_iterations,
                     "Steps of the first stage, with Huber kernel if `robust`.")
      .def_readwrite("final_iterations", &BundleOptions::final_iterations,
                     "Steps of the second stage, on the inliers, without kernel. 0: none.")
      .def_readwrite("robust", &BundleOptions::robust, "Kernel in the first stage.")
      .def_readwrite("n_threads", &BundleOptions::n_threads,
                     "With Ceres only 1 gives the same bytes in every run.")
      .def_readwrite("inverse_depth", &BundleOptions::inverse_depth,
                     "Step along inverse depths of points: for large maps, with one stage; Ceres\n"
                     "only.")
      .def_readwrite("max_seconds", &BundleOptions::max_seconds,
                     "No step is begun that would probably end later; 0: no limit.")
      .def_property(
          "solver", [](const BundleOptions& options) { return name_of(options.solver); },
          [](BundleOptions& options, const std::string& name) {
            options.solver = solver_named(name);
          },
          "`blocks`: our own, the same bytes with any number of threads; `ceres`.");
  py::class_<BundleSummary>(module, "BundleSummary", "What solve_bundle did.")
      .def_readonly("initial_cost", &BundleSummary::initial_cost,
                    "Sum of (robustified) squared whitened residuals at the start.")
      .def_readonly("final_cost", &BundleSummary::final_cost, "The same at the end.")
      .def_readonly("iterations", &BundleSummary::iterations, "Accepted steps.")
      .def_readonly("aborted", &BundleSummary::aborted, "The flag was raised.")
      .def_readonly("stage_one_done", &BundleSummary::stage_one_done,
                    "The first stage ran to its end.")
      .def_readonly("timed_out", &BundleSummary::timed_out,
                    "A time limit ended it; the result so far is used.")
      .def_property_readonly(
          "outlier", [](const BundleSummary& s) { return to_array(s.outlier); },
          "Per observation (n,) uint8, judged at the final estimate.");
  module.def(
      "solve_bundle", &solve_bundle_arrays, "T_cw"_a, "fixed"_a, "camera"_a.none(false), "points"_a,
      "camera_index"_a, "point_index"_a, "pixels"_a, "inverse_sigma2"_a,
      py::arg_v("options", BundleOptions(), "BundleOptions()"), "abort"_a = py::none(),
      "Bundle adjustment of arrays. Returns (poses, points (m, 3) float64, BundleSummary).\n\n"
      "`T_cw`: list of Pose; `fixed`: list of bool. `camera`: the Camera that sees from all\n"
      "poses. `points`: (m, 3) float64, world. `camera_index`, `point_index`: (n,) int64.\n"
      "`pixels`: (n, 3) undistorted u, v and the right column, NaN without depth.\n"
      "`inverse_sigma2`: (n,) [pixels^-2]. `abort`: StopFlag or None. Raises ValueError for bad\n"
      "shapes or indices.");
}

void bind_culling(py::module_& module) {
  module.def(
      "cull_keyframes",
      [](Map& map, KeyFrameId current, bool only_close, const InertialKeyframes* inertial) {
        std::vector<KeyFrameId> died;
        {
          const py::gil_scoped_release release;
          died = cull_keyframes(map, current, only_close, [&](KeyFrameId id) {
            return inertial != nullptr && inertial->is_needed(map, id);
          });
        }
        return to_array(died);
      },
      "map"_a, "current"_a, "only_close"_a, "inertial"_a = py::none(),
      "Remove redundant neighbours of a keyframe; those that died: (n,) int64.\n\n"
      "`inertial`: InertialKeyframes, whose chain in time keeps no long gaps; or None.");
}

void bind_local_bundle(py::module_& module) {
  bind_culling(module);
  py::class_<LocalBundleResult>(module, "LocalBundleResult", "What local_bundle_adjustment did.")
      .def_readonly("n_local_keyframes", &LocalBundleResult::n_local_keyframes,
                    "The keyframe and its neighbours.")
      .def_readonly("n_fixed_keyframes", &LocalBundleResult::n_fixed_keyframes,
                    "Cameras held still, local or not.")
      .def_readonly("n_points", &LocalBundleResult::n_points, "Points refined.")
      .def_readonly("n_observations", &LocalBundleResult::n_observations, "Observations used.")
      .def_readonly("n_imu_links", &LocalBundleResult::n_imu_links, "Residuals of the IMU.")
      .def_readonly("n_erased", &LocalBundleResult::n_erased, "Observations erased as outliers.")
      .def_readonly("committed", &LocalBundleResult::committed, "Whether the map was changed.")
      .def_readonly("summary", &LocalBundleResult::summary, "Of the solver.");
  module.def(
      "local_bundle_adjustment",
      [](Map& map, KeyFrameId keyframe, const std::shared_ptr<StopFlag>& abort, bool monocular,
         int n_threads, const std::string& solver, InertialKeyframes* inertial,
         bool measures_noise) {
        const BundleSolver chosen = solver_named(solver);
        const py::gil_scoped_release release;
        return local_bundle_adjustment(map, keyframe, flag_of(abort), monocular, n_threads, chosen,
                                       inertial, measures_noise);
      },
      "map"_a, "keyframe"_a, "abort"_a = py::none(), "monocular"_a = false, "n_threads"_a = 1,
      "solver"_a = name_of(BundleOptions().solver), "inertial"_a = py::none(),
      "measures_noise"_a = false,
      "Refine a keyframe, its neighbours and all their points; other observers are fixed.\n\n"
      "`abort`: a StopFlag polled once per iteration, or None. `monocular`: fix two poses, for\n"
      "the scale. `solver`: of BundleOptions. `inertial`: InertialKeyframes, whose newest ones "
      "are\n"
      "local, too, with residuals of the IMU between them; or None. `measures_noise`:\n"
      "alignment_noise() follows the residuals of aligned sightings. Takes the map's locks for\n"
      "short sections only. A\n"
      "dead or unknown keyframe gives an empty result, a reset in between drops it.");
}

void bind_full_bundle_steps(py::module_& module) {
  py::class_<GatheredBundle>(module, "GatheredBundle",
                             "A copy of the keyframes and points of a map to be refined together.")
      .def_property_readonly(
          "n_keyframes", [](const GatheredBundle& b) { return b.keyframes.size(); },
          "Keyframes, the fixed one included.")
      .def_property_readonly(
          "n_points", [](const GatheredBundle& b) { return b.points.size(); }, "Points.")
      .def_property_readonly(
          "n_observations", [](const GatheredBundle& b) { return b.problem.observations.size(); },
          "Observations.")
      .def_readonly("solved", &GatheredBundle::solved, "It holds a result that may be committed.");
  py::class_<FullBundleCommit>(module, "FullBundleCommit", "What commit_full_bundle did.")
      .def_readonly("committed", &FullBundleCommit::committed, "Whether the map was changed.")
      .def_readonly("n_followed_keyframes", &FullBundleCommit::n_followed_keyframes,
                    "Keyframes that were not in the bundle and moved with their parents.")
      .def_readonly("n_followed_points", &FullBundleCommit::n_followed_points,
                    "Points that were not in the bundle and moved with their reference keyframe.");
  module.def("gather_full_bundle", &gather_full_bundle, "map"_a, "which"_a = kNoMap,
             py::call_guard<py::gil_scoped_release>(),
             "Copy all keyframes of a map (-1: the active one) that points tie to each other, and\n"
             "these points.\n\n"
             "First of the three steps of a full bundle adjustment, which refines them all and\n"
             "erases no observation. The map may change between the steps. Takes the read lock.");
  module.def(
      "solve_full_bundle",
      [](GatheredBundle& bundle, const FullBundleOptions& options,
         const std::shared_ptr<StopFlag>& abort,
         int n_threads) { return solve_full_bundle(bundle, options, flag_of(abort), n_threads); },
      "bundle"_a, py::arg_v("options", FullBundleOptions(), "FullBundleOptions()"),
      "abort"_a = py::none(), "n_threads"_a = 1, py::call_guard<py::gil_scoped_release>(),
      "Refine a gathered bundle; returns a BundleSummary. Takes no lock.\n\n"
      "`abort`: a StopFlag polled once per iteration, or None; the result of an aborted run is "
      "not\n"
      "committed, nor is a result that is worse or not finite.");
  module.def("commit_full_bundle", &commit_full_bundle, "map"_a, "bundle"_a,
             py::call_guard<py::gil_scoped_release>(),
             "Move the map to the result in one write section, which counts as a big change.\n\n"
             "Keyframes and points made since the gathering move along with their parents and\n"
             "reference keyframes; objects that have died are left out. Nothing is changed when "
             "the bundle\n"
             "is not solved, or when the map was cleared or had another big change since. Pause "
             "local mapping for it.");
}

void bind_full_bundle(py::module_& module) {
  py::class_<FullBundleOptions>(module, "FullBundleOptions", "How solve_full_bundle works.")
      .def(py::init([](int iterations, bool robust, double max_seconds) {
             return FullBundleOptions{iterations, robust, max_seconds};
           }),
           "iterations"_a = 10, "robust"_a = true, "max_seconds"_a = 0.0)
      .def_readwrite("iterations", &FullBundleOptions::iterations, "Accepted steps at most.")
      .def_readwrite("robust", &FullBundleOptions::robust, "Huber kernel on all observations.")
      .def_readwrite("max_seconds", &FullBundleOptions::max_seconds,
                     "No step is begun that would probably end later; the result so far is used.\n"
                     "0: no limit, and results do not depend on the speed of the machine.");
  bind_full_bundle_steps(module);
}

void bind_monocular_map(py::module_& module) {
  py::enum_<MonocularMapFailure>(module, "MonocularMapFailure",
                                 "Why create_monocular_map made no map.")
      .value("NONE", MonocularMapFailure::kNone, "It did.")
      .value("FEW_POINTS", MonocularMapFailure::kFewPoints,
             "Fewer than `min_points` points in the second keyframe.")
      .value("BAD_DEPTH", MonocularMapFailure::kBadDepth,
             "The median depth is not a positive number.")
      .value("MAP_CLEARED", MonocularMapFailure::kMapCleared, "The map was cleared in between.");
  py::class_<MonocularMap>(module, "MonocularMap", "What create_monocular_map did.")
      .def_readonly("ok", &MonocularMap::ok, "There is a map. Otherwise: clear the Map.")
      .def_readonly("failure", &MonocularMap::failure, "Why not.")
      .def_readonly("first", &MonocularMap::first, "Keyframe of the initial frame: 0.")
      .def_readonly("second", &MonocularMap::second, "Keyframe of the current frame: 1.")
      .def_readonly("n_points", &MonocularMap::n_points, "Points of the second keyframe.")
      .def_readonly("median_depth", &MonocularMap::median_depth,
                    "Median depth in the first keyframe before it was scaled to 1, in units of\n"
                    "the given baseline; NaN without points.")
      .def_readonly("summary", &MonocularMap::summary, "Of the bundle adjustment.");
  module.def(
      "create_monocular_map",
      [](Map& map, TrackedFrame& initial, TrackedFrame& current, const Pose& T_21,
         const Input<std::int32_t>& matches, const Input<double>& points, std::size_t min_points) {
        const std::size_t n = rows_of(matches, 0, "matches");
        check_rows(rows_of(points, 3, "points"), n, "points");
        const std::vector<int> partners(matches.data(), matches.data() + n);
        std::vector<Eigen::Vector3d> positions(n);
        for (std::size_t i = 0; i < n; ++i) {
          positions[i] = Eigen::Map<const Eigen::Vector3d>(points.data() + 3 * i);
        }
        const py::gil_scoped_release release;
        return create_monocular_map(map, initial, current, T_21, partners, positions, min_points);
      },
      "map"_a, "initial"_a, "current"_a, "T_21"_a, "matches"_a, "points"_a,
      "min_points"_a = kFewestInitialPoints,
      "Make the first map of a single camera from two described frames.\n\n"
      "`T_21`: initial to current camera, up to scale. `matches`: (n,) int32, per initial "
      "keypoint\n"
      "its partner in `current` or -1, one to one. `points`: (n, 3) float64, per initial keypoint\n"
      "its position in the initial camera, in the units of `T_21`; read where matched. Keyframes\n"
      "0 and 1 and their points are refined together, scaled to median depth 1 in keyframe 0,\n"
      "and published; local mapping takes both, in order, afterwards. On success both frames\n"
      "have final poses, points and reference keyframes. On failure they are unchanged and the\n"
      "map must be cleared. Returns MonocularMap. Raises StateError when the map is not empty, a\n"
      "frame is not described or the matches do not fit the frames.");
}

}  // namespace

void bind_optimize(py::module_& module) {
  bind_pose_optimization(module);
  bind_frame_sightings(module);
  bind_bundle(module);
  bind_local_bundle(module);
  bind_full_bundle(module);
  bind_monocular_map(module);
}

}  // namespace orbslam::bindings
