// SPDX-License-Identifier: BSD-3-Clause
#include "loops/loop_correction.hpp"

#include <pybind11/stl.h>

#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "bindings/stop_flag.hpp"

namespace orbslam::bindings {
namespace {

using namespace py::literals;

void bind_results(py::module_& module) {
  py::class_<PoseGraphSummary>(module, "PoseGraphSummary", "What optimize_essential_graph did.")
      .def_readonly("initial_cost", &PoseGraphSummary::initial_cost,
                    "Sum of squared residuals at the start.")
      .def_readonly("final_cost", &PoseGraphSummary::final_cost, "The same at the end.")
      .def_readonly("iterations", &PoseGraphSummary::iterations, "Accepted steps.")
      .def_readonly("aborted", &PoseGraphSummary::aborted,
                    "The flag was raised: the correction must not be applied.");
  py::class_<LoopCorrectionResult>(module, "LoopCorrectionResult",
                                   "What apply_loop_correction did.")
      .def_readonly("applied", &LoopCorrectionResult::applied,
                    "False: the map was cleared meanwhile, or an end of the loop died.")
      .def_readonly("n_fused", &LoopCorrectionResult::n_fused,
                    "Points replaced by points of the far side, or observations added to these.")
      .def_readonly("translation", &LoopCorrectionResult::translation,
                    "How far `current` moved [m].")
      .def_readonly("rotation", &LoopCorrectionResult::rotation, "By what angle it turned [rad].")
      .def_readonly("scale", &LoopCorrectionResult::scale,
                    "By what lengths around it were multiplied.");
}

void bind_correction(py::module_& module) {
  py::class_<LoopCorrection>(module, "LoopCorrection",
                             "What closing a loop does to the map, worked out on copies.")
      .def_property_readonly(
          "n_keyframes", [](const LoopCorrection& c) { return c.keyframes.size(); },
          "Keyframes in the essential graph. 0: an end of the loop was dead.")
      .def_property_readonly(
          "n_edges", [](const LoopCorrection& c) { return c.graph.edges.size(); },
          "Measurements between them.")
      .def_property_readonly(
          "n_fusions", [](const LoopCorrection& c) { return c.fusions.size(); },
          "Points to be replaced by points of the far side, or to be seen by more keyframes.")
      .def_property_readonly(
          "n_points", [](const LoopCorrection& c) { return c.carried.size(); },
          "Points that move along.");
  module.def(
      "plan_loop_correction", &plan_loop_correction, "map"_a, "loop"_a, "fix_scale"_a, Release(),
      "Work out how a loop corrects the map.\n\n"
      "Carries the loop's similarity to the neighbours of its current keyframe, finds which "
      "points\n"
      "are in the map twice, and builds the essential graph. `fix_scale`: where depth is "
      "measured.\n"
      "Takes the map's read lock in short sections; the map is not changed. Local mapping must\n"
      "rest until apply_loop_correction() is through. Raises ValueError when the loop's matches\n"
      "are not one per keypoint. Returns a LoopCorrection.");
  module.def(
      "optimize_essential_graph",
      [](LoopCorrection& correction, const std::shared_ptr<StopFlag>& abort, int n_threads) {
        return optimize_essential_graph(correction, flag_of(abort), n_threads);
      },
      "correction"_a, "abort"_a = py::none(), "n_threads"_a = 1, Release(),
      "Spread the loop's error over all keyframes, in place, without locks.\n\n"
      "`abort`: a StopFlag polled once per iteration, or None. 1 thread gives the same bytes in\n"
      "every run. Returns a PoseGraphSummary.");
  module.def(
      "apply_loop_correction", &apply_loop_correction, "map"_a, "correction"_a, Release(),
      "Carry out a correction in one write section, so that everybody else sees the map before it\n"
      "or after it. Counts as a big change. Keyframes that are not in the graph (the tracker may\n"
      "just have inserted one) follow the keyframe before them. Returns a LoopCorrectionResult.");
}

}  // namespace

void bind_loop_correction(py::module_& module) {
  bind_results(module);
  bind_correction(module);
}

}  // namespace orbslam::bindings
