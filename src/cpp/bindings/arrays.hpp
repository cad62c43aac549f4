// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstring>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "base/ids.hpp"
#include "camera/camera.hpp"

namespace orbslam::bindings {

namespace py = pybind11;

/// An argument: an array of the items, converted and copied if it is not one.
template <class Item>
using Input = py::array_t<Item, py::array::c_style | py::array::forcecast>;
using IdArray = Input<std::int64_t>;

/// Rows of an (n, columns) array; columns 0: of an (n,) array. Raises ValueError naming it.
std::size_t rows_of(const py::array& array, py::ssize_t columns, const char* name);

std::vector<MapPointId> to_point_ids(const IdArray& array);

/// A new NumPy array of the given shape holding a copy of `count` items.
template <class Item>
py::array_t<Item> copy_to_array(const void* data, std::vector<py::ssize_t> shape) {
  py::array_t<Item> array(std::move(shape));
  if (array.nbytes() > 0) std::memcpy(array.mutable_data(), data, array.nbytes());
  return array;
}

template <class Item>
py::array_t<Item> to_array(const std::vector<Item>& values) {
  return copy_to_array<Item>(values.data(), {static_cast<py::ssize_t>(values.size())});
}

/// Ids as int64 with -1 for "none".
template <class Tag>
py::array_t<std::int64_t> to_array(const std::vector<Id<Tag>>& ids) {
  return copy_to_array<std::int64_t>(ids.data(), {static_cast<py::ssize_t>(ids.size())});
}

/// A cv::Mat header over a C-contiguous 2-D array; the array must outlive it. Throws ImageError
/// naming `what` when the array is not 2-D or its items are not `Item`.
cv::Mat view_uint8(const py::array& array, const char* what);
cv::Mat view_float32(const py::array& array, const char* what);

}  // namespace orbslam::bindings

namespace pybind11::detail {

/// Ids are plain integers in Python.
template <class Tag>
struct type_caster<orbslam::Id<Tag>> {
  PYBIND11_TYPE_CASTER(orbslam::Id<Tag>, const_name("int"));
  bool load(handle source, bool convert) {
    make_caster<std::int64_t> number;
    if (!number.load(source, convert)) return false;
    value = orbslam::Id<Tag>(cast_op<std::int64_t>(number));
    return true;
  }
  static handle cast(orbslam::Id<Tag> id, return_value_policy, handle) {
    return PyLong_FromLongLong(id.value);
  }
};

}  // namespace pybind11::detail
