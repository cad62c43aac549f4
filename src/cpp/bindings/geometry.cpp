// SPDX-License-Identifier: BSD-3-Clause
#include "geometry/triangulation.hpp"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "bindings/bindings.hpp"

namespace orbslam::bindings {

namespace py = pybind11;
using namespace py::literals;

void bind_geometry(py::module_& module) {
  module.def("triangulate", &triangulate, "ray_1"_a, "ray_2"_a, "T_1w"_a, "T_2w"_a,
             "World point (3,) of two normalised rays (x, y, 1) by linear triangulation; None when "
             "it lies at infinity.");
  module.def("fundamental_matrix", &fundamental_matrix, "T_1w"_a, "T_2w"_a, "K_1"_a, "K_2"_a,
             "F_12 (3, 3) with x_1^T F_12 x_2 = 0 for homogeneous pixels.");
}

}  // namespace orbslam::bindings
