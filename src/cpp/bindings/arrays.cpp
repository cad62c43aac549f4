// SPDX-License-Identifier: BSD-3-Clause
#include "bindings/arrays.hpp"

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

}  // namespace orbslam::bindings
