// SPDX-License-Identifier: BSD-3-Clause
#include "bindings/stop_flag.hpp"

#include <memory>

#include "bindings/bindings.hpp"

namespace orbslam::bindings {

namespace py = pybind11;

void bind_stop_flag(py::module_& module) {
  // Shared: the call that reads the flag runs without the GIL and keeps it alive.
  py::class_<StopFlag, std::shared_ptr<StopFlag>>(
      module, "StopFlag",
      "A flag by which one thread asks another's long call to end early. Lowered at first.")
      .def(py::init<>(), "A lowered flag.")
      .def("set", &StopFlag::set, "Raise the flag.")
      .def("clear", &StopFlag::clear, "Lower the flag.")
      .def("is_set", &StopFlag::is_set, "Whether the flag is raised.");
}

}  // namespace orbslam::bindings
