// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "bindings/bindings.hpp"
#include "geometry/triangulation.hpp"

namespace orbslam::bindings {

namespace py = pybind11;
using namespace py::literals;

void bind_geometry(py::module_& module) {
  module.def("triangulate", &triangulate, "ray_1"_a, "ray_2"_a, "T_1w"_a, "T_2w"_a,
             "Linear triangulation of two normalised rays (3,) with z = 1, each in its camera's\n"
             "frame. Returns the world point (3,) of least algebraic error, or None when it lies\n"
             "at infinity. It may lie behind a camera: check the depths.");
  module.def("fundamental_matrix", &fundamental_matrix, "T_1w"_a, "T_2w"_a, "K_1"_a, "K_2"_a,
             "The (3, 3) matrix F_12 with x_1^T F_12 x_2 = 0 for pixels (u, v, 1) of cameras with\n"
             "calibration matrices K_1 and K_2.");
}

}  // namespace orbslam::bindings
