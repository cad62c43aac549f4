// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/errors.hpp"
#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "frame/rectifier.hpp"
#include "frame/wide_pair.hpp"

namespace orbslam::bindings {
namespace {

using Image = py::array_t<std::uint8_t, py::array::c_style>;

/// A header over an image (h, w) or (h, w, channels), which must outlive it.
cv::Mat view(const Image& image) {
  if (image.ndim() != 2 && image.ndim() != 3) throw ImageError("an image has 2 or 3 dimensions");
  const py::ssize_t channels = image.ndim() == 3 ? image.shape(2) : 1;
  if (channels < 1 || channels > 4) throw ImageError("an image has 1 to 4 channels");
  return {static_cast<int>(image.shape(0)), static_cast<int>(image.shape(1)),
          CV_MAKETYPE(CV_8U, static_cast<int>(channels)), const_cast<std::uint8_t*>(image.data())};
}

/// An array that takes the pixels over. `like`: the array whose number of dimensions it gets.
Image array_of(cv::Mat&& image, const Image& like) {
  auto* const kept = new cv::Mat(std::move(image));
  const py::capsule owner(kept, [](void* p) { delete static_cast<cv::Mat*>(p); });
  std::vector<py::ssize_t> shape{kept->rows, kept->cols};
  if (like.ndim() == 3) shape.push_back(kept->channels());
  return Image(shape, kept->ptr(), owner);
}

Eigen::Matrix2Xd each(const Input<double>& pixels,
                      const std::function<Eigen::Vector2d(const Eigen::Vector2d&)>& convert) {
  const auto n = static_cast<py::ssize_t>(rows_of(pixels, 2, "pixels"));
  Eigen::Matrix2Xd all = Eigen::Map<const Eigen::Matrix2Xd>(pixels.data(), 2, n);
  for (Eigen::Index i = 0; i < all.cols(); ++i) all.col(i) = convert(all.col(i));
  return all;
}

void bind_rectifier(py::module_& module) {
  py::class_<Rectifier, std::shared_ptr<Rectifier>>(
      module, "Rectifier",
      "Rectifies images of a raw camera: resamples them as seen by a rotated pinhole.")
      .def(py::init([](const CameraModel& raw, const Eigen::Matrix3d& R, double fx, double fy,
                       double cx, double cy, int width, int height) {
             return std::make_shared<Rectifier>(raw, R, Pinhole{fx, fy, cx, cy},
                                                ImageSize{width, height});
           }),
           py::arg("raw"), py::arg("R"), py::arg("fx"), py::arg("fy"), py::arg("cx"), py::arg("cy"),
           py::arg("width"), py::arg("height"),
           "R (3, 3) turns raw into rectified camera coordinates; the others are of the rectified\n"
           "camera [px]. Raises SettingsError when they are out of range.")
      .def(
          "rectify",
          [](const Rectifier& self, const Image& image, bool is_mask) {
            const cv::Mat source = view(image);
            cv::Mat rectified;
            {
              const py::gil_scoped_release release;
              rectified = self.rectify(source, is_mask);
            }
            return array_of(std::move(rectified), image);
          },
          py::arg("image"), py::arg("is_mask") = false,
          "The rectified image of a raw one (h, w) or (h, w, channels) uint8: bilinear, or the\n"
          "nearest pixel for a mask; 0 where there is nothing. Raises ImageError for an image of\n"
          "another size.")
      .def(
          "to_raw",
          [](const Rectifier& self, const Input<double>& pixels) {
            const auto raw = each(pixels, [&](const auto& uv) { return self.to_raw(uv); });
            return copy_to_array<double>(raw.data(), {raw.cols(), 2});
          },
          py::arg("pixels"), "Raw pixels (n, 2) of rectified ones; NaN where nothing is seen.")
      .def(
          "from_raw",
          [](const Rectifier& self, const Input<double>& pixels) {
            const auto found = each(pixels, [&](const auto& uv) { return self.from_raw(uv); });
            return copy_to_array<double>(found.data(), {found.cols(), 2});
          },
          py::arg("pixels"), "Rectified pixels (n, 2) of raw ones; NaN beside the plane.");

  py::class_<PairRectifier, std::shared_ptr<PairRectifier>>(
      module, "PairRectifier", "Rectifies both images of a pair at the same time, in two threads.")
      .def(py::init([](const Rectifier& left, const Rectifier& right) {
             return std::make_shared<PairRectifier>(left, right);
           }),
           py::arg("left"), py::arg("right"))
      .def(
          "rectify",
          [](PairRectifier& self, const Image& left, const Image& right) {
            const cv::Mat left_source = view(left), right_source = view(right);
            std::pair<cv::Mat, cv::Mat> pair;
            {
              const py::gil_scoped_release release;
              pair = self.rectify(left_source, right_source);
            }
            return py::make_tuple(array_of(std::move(pair.first), left),
                                  array_of(std::move(pair.second), right));
          },
          py::arg("left"), py::arg("right"),
          "Rectified images (left, right) of raw ones; see Rectifier.rectify. Raises StateError\n"
          "while another thread uses this object.");
}

}  // namespace

void bind_raw_pairs(py::module_& module) {
  bind_rectifier(module);
  py::class_<WidePair, std::shared_ptr<WidePair>>(
      module, "WidePair", "A fisheye pair, matched along its epipolar curves.")
      .def(py::init([](const std::shared_ptr<Camera>& left, const CameraModel& right,
                       const Eigen::Matrix3d& R, const Eigen::Vector3d& t) {
             return std::make_shared<WidePair>(left, right, Pose(Eigen::Quaterniond(R), t));
           }),
           py::arg("left").none(false), py::arg("right"), py::arg("R_right_left"),
           py::arg("t_right_left"),
           "`left` was made with right_centre; R (3, 3) and t (3,) [m] take left camera "
           "coordinates\n"
           "into right ones. Raises SettingsError when the centres differ.")
      .def(
          "match",
          [](const WidePair& self, const Extraction& left, const Extraction& right,
             const ScalePyramid& scales) {
            StereoMatches matches;
            {
              const py::gil_scoped_release release;
              matches = self.match(left, right, scales);
            }
            return py::make_tuple(to_array(matches.right_u), to_array(matches.depth));
          },
          py::arg("left"), py::arg("right"), py::arg("scales"),
          "(right_u [px], depth [m] along the ray) of the left keypoints, float32, -1: none.");
}

}  // namespace orbslam::bindings
