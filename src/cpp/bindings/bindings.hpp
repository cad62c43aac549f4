// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <pybind11/pybind11.h>

namespace orbslam::bindings {

/// For functions that neither take the GIL nor Python's objects.
using Release = pybind11::call_guard<pybind11::gil_scoped_release>;

// One function per folder of src/cpp, or per part of one, defined in the file of the same name.
void bind_base(pybind11::module_& module);
void bind_stop_flag(pybind11::module_& module);
void bind_images(pybind11::module_& module);
void bind_features(pybind11::module_& module);
void bind_camera(pybind11::module_& module);
void bind_camera_model(pybind11::module_& module);
void bind_inertial(pybind11::module_& module);
void bind_frame(pybind11::module_& module);
void bind_raw_pairs(pybind11::module_& module);
void bind_rig(pybind11::module_& module);
void bind_frame_evidence(pybind11::module_& module);
void bind_map(pybind11::module_& module);
void bind_places(pybind11::module_& module);
void bind_map_contents(pybind11::module_& module);
void bind_geometry(pybind11::module_& module);
void bind_matching(pybind11::module_& module);
void bind_inertial_keyframes(pybind11::module_& module);
void bind_optimize(pybind11::module_& module);
void bind_alignment(pybind11::module_& module);
void bind_loops(pybind11::module_& module);
void bind_loop_correction(pybind11::module_& module);
void bind_synthetic(pybind11::module_& module);

}  // namespace orbslam::bindings
