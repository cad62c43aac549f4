// SPDX-License-Identifier: BSD-3-Clause
#include "bindings/bindings.hpp"

PYBIND11_MODULE(_core, module) {
  using namespace orbslam::bindings;
  module.doc() =
      "C++ core of orbslam2py: types (Frame, Map, Vocabulary, ...) and functions on them.";
  // Bottom to top, so that every signature finds its types registered.
  bind_base(module);
  bind_stop_flag(module);
  bind_images(module);
  bind_features(module);
  bind_camera_model(module);
  bind_camera(module);
  bind_inertial(module);
  bind_raw_pairs(module);
  bind_frame(module);
  bind_rig(module);
  bind_frame_evidence(module);
  bind_map(module);
  bind_places(module);
  bind_map_contents(module);
  bind_geometry(module);
  bind_matching(module);
  bind_inertial_keyframes(module);
  bind_optimize(module);
  bind_alignment(module);
  bind_loops(module);
  bind_loop_correction(module);
  bind_synthetic(module);
}
