// SPDX-License-Identifier: BSD-3-Clause
#include "optimize/inertial_keyframes.hpp"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"

namespace orbslam::bindings {
namespace {

using namespace py::literals;
using InertialVersion = std::array<std::int64_t, 3>;

// Rows of arrays are copied as they are.
static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double));
static_assert(sizeof(ImuBias) == 6 * sizeof(double));
static_assert(sizeof(ImuSample) == 7 * sizeof(double));

/// Copies the rows of an array (n, columns), or (n,) for 0; raises ValueError naming it.
template <class Row, class Item>
std::vector<Row> rows_from(const Input<Item>& array, py::ssize_t columns, const char* name) {
  std::vector<Row> rows(rows_of(array, columns, name));
  if (!rows.empty()) {
    std::memcpy(reinterpret_cast<void*>(rows.data()), array.data(), rows.size() * sizeof(Row));
  }
  return rows;
}

template <class Row>
py::array_t<double> rows_to_array(const std::vector<Row>& rows, py::ssize_t columns) {
  return copy_to_array<double>(rows.data(), {static_cast<py::ssize_t>(rows.size()), columns});
}

Vector6d inertial_vector(const ImuBias& bias) {
  Vector6d both;
  both << bias.gyro, bias.accel;
  return both;
}

py::dict take_states(const InertialKeyframes& self, const IdArray& keyframes,
                     const Input<double>& timestamps, const IdArray& known) {
  const auto ids = rows_from<KeyFrameId>(keyframes, 0, "keyframes");
  const auto times = rows_from<double>(timestamps, 0, "timestamps");
  if (times.size() != ids.size()) throw py::value_error("as many timestamps as keyframes");
  auto versions = rows_from<InertialVersion>(known, 3, "known");
  InertialRows rows;
  {
    const py::gil_scoped_release release;
    std::sort(versions.begin(), versions.end());
    rows = self.take(ids, times, versions);
  }
  py::dict arrays;
  const auto n = static_cast<py::ssize_t>(rows.ids.size());
  arrays["ids"] = to_array(rows.ids);
  arrays["velocity"] = rows_to_array(rows.velocity, 3);
  arrays["scale"] = to_array(rows.scale);
  arrays["bias"] = rows_to_array(rows.bias, 6);
  const std::vector<std::int64_t> offsets(rows.offsets.begin(), rows.offsets.end());
  arrays["offsets"] = to_array(offsets);
  arrays["samples"] = rows_to_array(rows.samples, 7);
  arrays["versions"] = copy_to_array<std::int64_t>(rows.versions.data(), {n, 3});
  arrays["changed"] = copy_to_array<bool>(rows.changed.data(), {n});
  return arrays;
}

void put_states(InertialKeyframes& self, const IdArray& ids, const Input<double>& velocity,
                const Input<double>& scale, const Input<double>& bias, const IdArray& offsets,
                const Input<double>& samples) {
  InertialRows rows;
  rows.ids = rows_from<KeyFrameId>(ids, 0, "ids");
  rows.velocity = rows_from<Eigen::Vector3d>(velocity, 3, "velocity");
  rows.scale = rows_from<double>(scale, 0, "scale");
  rows.bias = rows_from<ImuBias>(bias, 6, "bias");
  rows.samples = rows_from<ImuSample>(samples, 7, "samples");
  const auto ends = rows_from<std::int64_t>(offsets, 0, "offsets");
  rows.offsets.assign(ends.begin(), ends.end());
  const std::size_t n = rows.ids.size();
  const bool fits = rows.velocity.size() == n && rows.scale.size() == n && rows.bias.size() == n &&
                    ends.size() == n + 1 && ends.front() == 0 &&
                    ends.back() == static_cast<std::int64_t>(rows.samples.size()) &&
                    std::is_sorted(ends.begin(), ends.end());
  if (!fits) throw py::value_error("the arrays of the states do not have fitting lengths");
  self.put(rows);
}

}  // namespace

void bind_inertial_keyframes(py::module_& module) {
  using K = InertialKeyframes;
  py::class_<K>(module, "InertialKeyframes",
                "Samples of an IMU, and its velocities and biases at keyframes.")
      .def(py::init([](const Pose& T_cb, const Eigen::Vector4d& noise) {
             return std::make_unique<K>(T_cb, ImuNoise{noise(0), noise(1), noise(2), noise(3)});
           }),
           "T_cb"_a, "noise"_a, "As of InertialFilter.")
      .def("__len__", &K::size)
      .def(
          "add_samples",
          [](K& self, const Input<double>& samples) {
            self.add_samples(rows_from<ImuSample>(samples, 7, "samples"));
          },
          "samples"_a, "Samples (n, 7) after those before, which they may overlap by one.")
      .def(
          "set",
          [](K& self, KeyFrameId keyframe, const Eigen::Vector3d& velocity, const Vector6d& bias) {
            self.set(keyframe, velocity, {bias.head<3>(), bias.tail<3>()});
          },
          "keyframe"_a, "velocity"_a, "bias"_a,
          "Velocity of the IMU (3,) [m/s] in the axes of the camera of a keyframe that was just "
          "inserted, and its bias (6,).")
      .def(
          "find",
          [](const K& self, KeyFrameId keyframe) -> py::object {
            Eigen::Vector3d velocity;
            ImuBias bias;
            if (!self.find(keyframe, velocity, bias)) return py::none();
            return py::make_tuple(velocity, inertial_vector(bias));
          },
          "keyframe"_a, "Velocity (3,) and bias (6,) of a keyframe, as of `set`; or None.")
      .def_property_readonly(
          "newest_bias",
          [](const K& self) -> py::object {
            ImuBias bias;
            if (!self.newest_bias(bias)) return py::none();
            return py::cast(inertial_vector(bias));
          },
          "Bias (6,) of the keyframe with the highest id; None without any.")
      .def("take", &take_states, "keyframes"_a, "timestamps"_a,
           "known"_a = py::array_t<std::int64_t>(std::vector<py::ssize_t>{0, 3}),
           "The states of these keyframes (ascending ids, with their seconds) and the samples "
           "between them, as arrays by name: see orbslam2py.maps.ImuStates. Beside these "
           "`versions` (m, 3), equal for equal rows, and `changed` (m,): the version is not in "
           "`known` (n, 3); other rows come without their samples.")
      .def("put", &put_states, "ids"_a, "velocity"_a, "scale"_a, "bias"_a, "offsets"_a, "samples"_a,
           "Replace everything by the states of an earlier run, as `take` gives them. Samples that "
           "come later join none of them. Raises ValueError for lengths that do not fit.")
      .def("clear", &K::clear, "Forget everything.");
}

}  // namespace orbslam::bindings
