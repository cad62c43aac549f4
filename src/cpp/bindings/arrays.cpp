// SPDX-License-Identifier: BSD-3-Clause
#include "bindings/arrays.hpp"

#include <algorithm>
#include <limits>
#include <string>

#include "base/errors.hpp"

namespace orbslam::bindings {
namespace {

cv::Mat view(const py::array& array, const char* what, const py::dtype& wanted, int type) {
  const std::string name(what);
  if (!array.dtype().is(wanted) && !array.dtype().equal(wanted)) {
    throw ImageError(name + " must hold " + std::string(py::str(wanted)) + ", got " +
                     std::string(py::str(array.dtype())) + "; convert it with astype");
  }
  if (array.ndim() != 2) {
    throw ImageError(name + " must be 2-D (rows, columns), got " + std::to_string(array.ndim()) +
                     " dimensions");
  }
  if ((array.flags() & py::array::c_style) == 0) {
    throw ImageError(name + " must be C-contiguous; pass it through numpy.ascontiguousarray");
  }
  constexpr py::ssize_t limit = std::numeric_limits<int>::max();
  if (array.shape(0) > limit || array.shape(1) > limit) throw ImageError(name + " is too large");
  // OpenCV has no headers over constant data; the callers only read.
  return cv::Mat(static_cast<int>(array.shape(0)), static_cast<int>(array.shape(1)), type,
                 const_cast<void*>(array.data()));
}

}  // namespace

cv::Mat view_uint8(const py::array& array, const char* what) {
  return view(array, what, py::dtype::of<std::uint8_t>(), CV_8UC1);
}

cv::Mat view_float32(const py::array& array, const char* what) {
  return view(array, what, py::dtype::of<float>(), CV_32FC1);
}

std::size_t rows_of(const py::array& array, py::ssize_t columns, const char* name) {
  const bool fits =
      columns == 0 ? array.ndim() == 1 : array.ndim() == 2 && array.shape(1) == columns;
  if (!fits) {
    const std::string shape = columns == 0 ? "(n,)" : "(n, " + std::to_string(columns) + ")";
    throw py::value_error(std::string(name) + " must have the shape " + shape);
  }
  return static_cast<std::size_t>(array.shape(0));
}

std::vector<MapPointId> to_point_ids(const IdArray& array) {
  if (array.ndim() != 1) throw py::value_error("point ids must be a 1-D array of int64");
  std::vector<MapPointId> ids(static_cast<std::size_t>(array.size()));
  std::transform(array.data(), array.data() + array.size(), ids.begin(),
                 [](std::int64_t id) { return MapPointId(id); });
  return ids;
}

}  // namespace orbslam::bindings
