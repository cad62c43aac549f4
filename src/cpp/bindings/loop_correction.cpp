// SPDX-License-Identifier: BSD-3-Clause
#include "loops/loop_correction.hpp"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "bindings/stop_flag.hpp"
#include "loops/map_merge.hpp"

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
                    "Distance that `current` moved [m].")
      .def_readonly("rotation", &LoopCorrectionResult::rotation, "Angle by which it turned [rad].")
      .def_readonly("scale", &LoopCorrectionResult::scale, "Factor of lengths around it.");
}

void bind_correction(py::module_& module) {
  py::class_<LoopCorrection>(
      module, "LoopCorrection",
      "The changes that closing a loop makes to the map, computed on copies.")
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
      "Plan how a loop corrects the map.\n\n"
      "Propagates the loop's similarity to the neighbours of its current keyframe, finds which "
      "points\n"
      "are in the map twice, and builds the essential graph. `fix_scale`: where depth is "
      "measured.\n"
      "Takes the map's read lock in short sections; the map is not changed. Local mapping "
      "must be paused until apply_loop_correction() has returned. Raises ValueError when "
      "the loop's matches\n"
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
      "Carry out a correction in one write section, so that other threads see the map before or "
      "after it. Counts as a big change. Keyframes that are not in the graph (the tracker may\n"
      "just have inserted one) follow the keyframe before them. Returns a LoopCorrectionResult.");
}

void bind_merge(py::module_& module) {
  py::class_<MapMerge>(module, "MapMerge",
                       "The changes that merging makes to two maps, computed on copies.")
      .def_readonly("kept", &MapMerge::kept, "The older map; -1: they cannot be joined.")
      .def_readonly("moved", &MapMerge::moved, "The younger one, which moves into its world.")
      .def_property_readonly(
          "S_km", [](const MapMerge& merge) { return merge.S_km.matrix(); },
          "(4, 4) float64 similarity: world of the moved map to that of the kept one.")
      .def_property_readonly(
          "n_fusions", [](const MapMerge& merge) { return merge.fusions.size(); },
          "Points to be replaced by points of the far side, or to be seen by more keyframes.");
  py::class_<MapMergeResult>(module, "MapMergeResult", "What apply_map_merge did.")
      .def_readonly("applied", &MapMergeResult::applied,
                    "False: the map was cleared meanwhile, or an end has died.")
      .def_readonly("kept", &MapMergeResult::kept)
      .def_readonly("moved", &MapMergeResult::moved)
      .def_readonly("n_moved_keyframes", &MapMergeResult::n_moved_keyframes)
      .def_readonly("n_moved_points", &MapMergeResult::n_moved_points)
      .def_readonly("n_fused", &MapMergeResult::n_fused, "Points replaced or seen by more.")
      .def_readonly("scale", &MapMergeResult::scale, "Factor of lengths in the moved map.");
  py::class_<KeyFramePoses>(module, "KeyFramePoses", "The poses of all keyframes of a map.")
      .def("__len__", [](const KeyFramePoses& self) { return self.ids.size(); })
      .def_property_readonly(
          "ids", [](const KeyFramePoses& self) { return to_array(self.ids); }, "(n,) int64.");
  module.def("plan_map_merge", &plan_map_merge, "map"_a, "loop"_a, "fix_scale"_a, Release(),
             "Plan how two maps become one: the younger one moves into the older one's world.\n\n"
             "`loop`: of keyframes of both. The map is not changed. Local mapping must be paused "
             "until apply_map_merge() has returned. Returns a MapMerge.");
  module.def("apply_map_merge", &apply_map_merge, "map"_a, "merge"_a, Release(),
             "Carry it out in one write section, which counts as a big change. Returns a\n"
             "MapMergeResult.");
  module.def(
      "keyframes_of_seam",
      [](const Map& map, KeyFrameId current) {
        std::vector<KeyFrameId> seam;
        {
          const py::gil_scoped_release release;
          seam = keyframes_of_seam(map, current);
        }
        return to_array(seam);
      },
      "map"_a, "current"_a, "The keyframe and its neighbours, ascending: (n,) int64.");
  module.def("poses_of_map", &poses_of_map, "map"_a, "which"_a, Release(),
             "Copy the poses of the published keyframes of a map.");
  module.def(
      "spread_from_seam",
      [](Map& map, const KeyFramePoses& before, const std::vector<std::int64_t>& seam,
         bool fix_scale, const std::shared_ptr<StopFlag>& abort) {
        std::vector<KeyFrameId> members;
        for (const std::int64_t id : seam) members.emplace_back(id);
        return spread_from_seam(map, before, members, fix_scale, flag_of(abort));
      },
      "map"_a, "before"_a, "seam"_a, "fix_scale"_a, "abort"_a = py::none(), Release(),
      "Spread the motion of an adjusted seam over the rest of the map, by a pose graph\n"
      "with the relative poses of `before`. Returns whether anything was moved.");
}

}  // namespace

void bind_loop_correction(py::module_& module) {
  bind_results(module);
  bind_correction(module);
  bind_merge(module);
}

}  // namespace orbslam::bindings
