// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "loops/loop_choice.hpp"
#include "loops/loop_detection.hpp"
#include "loops/loop_verification.hpp"

namespace orbslam::bindings {
namespace {

using namespace py::literals;

void bind_detection(py::module_& module) {
  py::class_<LoopConsistency>(
      module, "LoopConsistency",
      "Accepts a loop only if consecutive keyframes propose the same part of the map.\n\n"
      "Remembers the proposals of the keyframe before (Mur-Artal et al. 2015, section VII-A). For\n"
      "one thread.")
      .def(py::init<>())
      .def_property_readonly_static(
          "NEEDED", [](const py::object&) { return LoopConsistency::kNeeded; },
          "Consecutive confirmations that a candidate needs.")
      .def("update", &LoopConsistency::update, "map"_a, "candidates"_a, Release(),
           "Take the candidates of the next keyframe, ids in ascending order; none breaks all\n"
           "chains. Returns the list of those proposed by NEEDED keyframes before as well.")
      .def("clear", &LoopConsistency::clear, "Forget everything: after a correction or a gap.");
}

void bind_loop(py::module_& module) {
  py::class_<Loop>(module, "Loop",
                   "A place seen again. Poses are similarities: p_a = S_ab p_b with the scale in\n"
                   "the rotation's part. Arrays are copies.")
      .def_readonly("current", &Loop::current, "The present keyframe.")
      .def_readonly("matched", &Loop::matched, "The keyframe that showed the place before.")
      .def_property_readonly(
          "S_cm", [](const Loop& loop) { return loop.S_cm.matrix(); },
          "(4, 4) float64: camera of `matched` to camera of `current`.")
      .def_property_readonly(
          "S_cw", [](const Loop& loop) { return loop.S_cw.matrix(); },
          "(4, 4) float64: world to camera of `current` once the loop is corrected.")
      .def_property_readonly(
          "scale", [](const Loop& loop) { return loop.S_cm.scale(); },
          "Of S_cm: lengths around `current` over lengths around `matched`.")
      .def_property_readonly(
          "matches", [](const Loop& loop) { return to_array(loop.matches); },
          "(n,) int64: per keypoint of `current` the point of the far side, or -1.")
      .def_property_readonly(
          "loop_points", [](const Loop& loop) { return to_array(loop.loop_points); },
          "(m,) int64: all points around `matched`.")
      .def_readonly("n_inliers", &Loop::n_inliers,
                    "Matches that the refined similarity was judged on.")
      .def_readonly("n_matches", &Loop::n_matches, "Entries of `matches` that are points.");
}

void bind_verification(py::module_& module) {
  py::class_<LoopVerificationOptions>(module, "LoopVerificationOptions",
                                      "Options of verify_loop_candidate().")
      .def(py::init([](bool fix_scale, std::uint64_t seed, int min_word_matches, int min_inliers,
                       int min_matches) {
             return LoopVerificationOptions{fix_scale, seed, min_word_matches, min_inliers,
                                            min_matches};
           }),
           "fix_scale"_a = LoopVerificationOptions().fix_scale,
           "seed"_a = LoopVerificationOptions().seed,
           "min_word_matches"_a = LoopVerificationOptions().min_word_matches,
           "min_inliers"_a = LoopVerificationOptions().min_inliers,
           "min_matches"_a = LoopVerificationOptions().min_matches)
      .def_readwrite("fix_scale", &LoopVerificationOptions::fix_scale,
                     "Where depth is measured the scale cannot drift.")
      .def_readwrite("seed", &LoopVerificationOptions::seed,
                     "Of the system; the draws depend on it and on both ids.")
      .def_readwrite("min_word_matches", &LoopVerificationOptions::min_word_matches)
      .def_readwrite("min_inliers", &LoopVerificationOptions::min_inliers,
                     "Of the refinement; RANSAC must find more.")
      .def_readwrite("min_matches", &LoopVerificationOptions::min_matches,
                     "With the points around the candidate projected.");
  module.def(
      "verify_loop_candidate", &verify_loop_candidate, "map"_a, "current"_a, "candidate"_a,
      "options"_a, Release(),
      "Verify by geometry that two keyframes show the same place.\n\n"
      "Matches by words, a similarity by RANSAC, guided matching, refinement, projection of\n"
      "the points around the candidate. Returns a Loop, or None when a step finds too little or\n"
      "a keyframe is dead. The map is not changed.");
}

void bind_choice(py::module_& module) {
  py::class_<LoopDrift>(module, "LoopDrift",
                        "Largest possible drift between the keyframes of a loop,\n"
                        "and the drift that the loop measures. Lengths in units of the map.")
      .def_readonly("path", &LoopDrift::path,
                    "Metres of the shortest way along the keyframe graph; inf without a way.")
      .def_readonly("turned", &LoopDrift::turned, "Radians turned along it.")
      .def_readonly("reach", &LoopDrift::reach,
                    "Metres from `current` to the keyframe on it farthest away.")
      .def_readonly("scene_depth", &LoopDrift::scene_depth,
                    "Median depth of `current`'s points [m].")
      .def_readonly("translation", &LoopDrift::translation, "Metres that `current` would move.")
      .def_readonly("rotation", &LoopDrift::rotation, "Radians that `current` would turn.")
      .def_readonly("scale", &LoopDrift::scale, "Scale of S_cm.")
      .def_readonly("max_translation", &LoopDrift::max_translation, "Limit of `translation`.")
      .def_readonly("max_rotation", &LoopDrift::max_rotation, "Limit of `rotation`.")
      .def_readonly("max_log_scale", &LoopDrift::max_log_scale, "Limit of |log(scale)|.")
      .def("plausible", &LoopDrift::plausible, "Whether drift can explain the loop.");
  module.def("assess_drift", &assess_drift, "map"_a, "loop"_a, "fix_scale"_a, Release(),
             "Compare a loop's correction with what drift can explain. Returns a LoopDrift.");
  module.def("choose_loop", &choose_loop, "map"_a, "loops"_a, "fix_scale"_a, Release(),
             "The plausible loop with most matches among loops of one keyframe.\n\n"
             "None when there is none, or when plausible ones put the keyframe at different\n"
             "places. Raises ValueError when the loops are of different keyframes.");
  module.def(
      "choose_merge", &choose_merge, "map"_a, "loops"_a, "fix_scale"_a, Release(),
      "Among places that one keyframe shows in other maps, that with most matches.\n\n"
      "None when there is none, or when two are in different maps or contradict each other.");
  module.def(
      "may_be_one_place", &may_be_one_place, "map"_a, "a"_a, "T_aw"_a, "b"_a, "T_bw"_a,
      "fix_scale"_a, Release(),
      "Whether a camera found at keyframes a and b of a map, with poses T_aw and T_bw, may be\n"
      "at one place: whether drift between them explains how far the poses are apart.");
}

}  // namespace

void bind_loops(py::module_& module) {
  bind_detection(module);
  bind_loop(module);
  bind_verification(module);
  bind_choice(module);
}

}  // namespace orbslam::bindings
