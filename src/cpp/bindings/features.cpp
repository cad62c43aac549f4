// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/stl.h>

#include <algorithm>
#include <memory>
#include <string>

#include "base/errors.hpp"
#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "bindings/one_thread.hpp"
#include "features/orb_extractor.hpp"

namespace orbslam::bindings {
namespace {

using Bytes = py::array_t<std::uint8_t, py::array::c_style | py::array::forcecast>;

py::array_t<float> keypoint_rows(const std::vector<Keypoint>& keypoints) {
  py::array_t<float> rows({static_cast<py::ssize_t>(keypoints.size()), py::ssize_t{5}});
  float* out = rows.mutable_data();
  for (const Keypoint& keypoint : keypoints) {
    *out++ = keypoint.x;
    *out++ = keypoint.y;
    *out++ = keypoint.size;
    *out++ = keypoint.angle;
    *out++ = keypoint.response;
  }
  return rows;
}

py::array_t<std::int32_t> keypoint_levels(const std::vector<Keypoint>& keypoints) {
  py::array_t<std::int32_t> levels(static_cast<py::ssize_t>(keypoints.size()));
  std::transform(keypoints.begin(), keypoints.end(), levels.mutable_data(),
                 [](const Keypoint& keypoint) { return keypoint.level; });
  return levels;
}

py::array_t<std::uint8_t> image_copy(const cv::Mat& image) {
  py::array_t<std::uint8_t> array({py::ssize_t{image.rows}, py::ssize_t{image.cols}});
  for (int y = 0; y < image.rows; ++y) {
    std::copy_n(image.ptr<std::uint8_t>(y), image.cols, array.mutable_data(y, 0));
  }
  return array;
}

/// Also of arrays that are not contiguous, such as a window of a larger image.
cv::Mat copy_of(const py::array& array, const char* what) {
  return view_uint8(py::array::ensure(array, py::array::c_style), what).clone();
}

/// Refuses a second thread instead of letting two share the scratch buffers.
struct SharedExtractor {
  OrbExtractor extractor;
  OneThread one_thread;

  SharedExtractor(const OrbOptions& options, const std::string& kernels)
      : extractor(options, vector_unit(kernels)) {}

  Extraction extract(const py::array& image, const py::object& mask) {
    const OneThread::Use use(
        one_thread, "this extractor is extracting in another thread; give each thread its own");
    // Level 0 of the result shares the pixels it was made from, which must outlive the caller's
    // array and not change while other Python threads run.
    const cv::Mat pixels = copy_of(image, "the image");
    const cv::Mat allowed = mask.is_none() ? cv::Mat() : copy_of(py::array(mask), "the mask");
    if (!mask.is_none() && allowed.empty()) throw ImageError("the mask is empty; pass None");
    const py::gil_scoped_release release;
    return extractor.extract(pixels, allowed);
  }
};

void bind_orb_options(py::module_& module) {
  py::class_<OrbOptions>(module, "OrbOptions", "Parameters of the ORB extractor.")
      .def(py::init([](int n_features, float scale_factor, int n_levels, int initial_threshold,
                       int minimum_threshold, bool original_coordinates) {
             const OrbOptions options{n_features,        scale_factor,      n_levels,
                                      initial_threshold, minimum_threshold, original_coordinates};
             options.check();
             return options;
           }),
           py::arg("n_features") = 1000, py::arg("scale_factor") = 1.2F, py::arg("n_levels") = 8,
           py::arg("initial_threshold") = 20, py::arg("minimum_threshold") = 7,
           py::arg("original_coordinates") = false,
           "Raises SettingsError naming the option that is out of range.")
      .def_readonly("n_features", &OrbOptions::n_features, "Keypoints wanted, all levels together.")
      .def_readonly("scale_factor", &OrbOptions::scale_factor, "Ratio between levels.")
      .def_readonly("n_levels", &OrbOptions::n_levels, "Number of pyramid levels.")
      .def_readonly("initial_threshold", &OrbOptions::initial_threshold,
                    "FAST threshold, grey levels.")
      .def_readonly("minimum_threshold", &OrbOptions::minimum_threshold,
                    "FAST threshold of cells where the first finds nothing.")
      .def_readonly("original_coordinates", &OrbOptions::original_coordinates,
                    "Keypoints of coarse levels lie at multiples of the scale, where the original "
                    "puts them, and not at their true place.")
      .def("__repr__", [](const OrbOptions& options) {
        return "OrbOptions(n_features=" + std::to_string(options.n_features) +
               ", scale_factor=" + std::to_string(options.scale_factor) +
               ", n_levels=" + std::to_string(options.n_levels) +
               ", initial_threshold=" + std::to_string(options.initial_threshold) +
               ", minimum_threshold=" + std::to_string(options.minimum_threshold) +
               ", original_coordinates=" + (options.original_coordinates ? "True" : "False") + ")";
      });
}

void bind_extraction(py::module_& module) {
  py::class_<Extraction>(module, "Extraction", "Features of one image and the pyramid they lie in.")
      .def("__len__", [](const Extraction& result) { return result.features.size(); })
      .def_property_readonly(
          "keypoints",
          [](const Extraction& result) { return keypoint_rows(result.features.keypoints); },
          "(n, 5) float32: x, y (level-0 pixels), size (pixels), angle (degrees), response.")
      .def_property_readonly(
          "levels",
          [](const Extraction& result) { return keypoint_levels(result.features.keypoints); },
          "(n,) int32: pyramid level of each keypoint.")
      .def_property_readonly(
          "descriptors",
          [](const Extraction& result) {
            const auto& descriptors = result.features.descriptors;
            return copy_to_array<std::uint8_t>(
                descriptors.data(),
                {static_cast<py::ssize_t>(descriptors.size()), py::ssize_t{sizeof(Descriptor)}});
          },
          "(n, 32) uint8: 256 bits, test i is bit i % 8 of byte i // 8.")
      .def_property_readonly(
          "pyramid",
          [](const Extraction& result) {
            py::list levels;
            for (const cv::Mat& level : result.pyramid.levels) levels.append(image_copy(level));
            return levels;
          },
          "List of (height, width) uint8 images, level 0 first; copies.");
}

void bind_extractor(py::module_& module) {
  py::class_<SharedExtractor>(module, "OrbExtractor",
                              R"(Distributed FAST corners with rotated BRIEF descriptors.

One thread at a time per extractor; several extractors may run side by side. The result depends on
the image and the options only.)")
      .def(
          py::init<const OrbOptions&, const std::string&>(), py::arg("options") = OrbOptions{},
          py::arg("kernels") = "automatic",
          "`kernels`: 'automatic', or one of `vector_units`, or 'portable', the first of them; all "
          "give the same bytes. Raises SettingsError for kernels this processor cannot run.")
      .def("extract", &SharedExtractor::extract, py::arg("image"), py::arg("mask") = py::none(),
           R"(Extracts features.

`image`: (height, width) uint8, grey. `mask`: None, or uint8 of the same shape with 0 where no
keypoint may lie. Raises ImageError for anything else, StateError while another thread uses this
extractor.)")
      .def_property_readonly(
          "options", [](const SharedExtractor& self) { return self.extractor.options(); },
          "The options.")
      .def_property_readonly(
          "scales", [](const SharedExtractor& self) { return self.extractor.scales(); },
          "The scale tables.")
      .def_property_readonly(
          "kernel_name",
          [](const SharedExtractor& self) { return name_of(self.extractor.vector_unit()); },
          "The vector unit whose inner loops are in use: one of `vector_units`.");
}

std::vector<Descriptor> descriptors_of(const Bytes& rows, const char* what) {
  if (rows.ndim() != 2 || rows.shape(1) != py::ssize_t{sizeof(Descriptor)}) {
    throw py::value_error(std::string(what) + " must have the shape (n, 32)");
  }
  std::vector<Descriptor> descriptors(static_cast<std::size_t>(rows.shape(0)));
  if (!descriptors.empty()) {
    std::memcpy(static_cast<void*>(descriptors.data()), rows.data(),
                static_cast<std::size_t>(rows.nbytes()));
  }
  return descriptors;
}

py::array_t<std::int32_t> hamming_distances(const Bytes& a, const Bytes& b) {
  const auto first = descriptors_of(a, "a"), second = descriptors_of(b, "b");
  if (first.size() != second.size()) throw py::value_error("a and b must have the same length");
  std::vector<std::int32_t> distances(first.size());
  std::transform(first.begin(), first.end(), second.begin(), distances.begin(), hamming_distance);
  return to_array(distances);
}

py::array_t<std::int32_t> hamming_matrix(const Bytes& a, const Bytes& b) {
  const auto first = descriptors_of(a, "a"), second = descriptors_of(b, "b");
  py::array_t<std::int32_t> distances(
      {static_cast<py::ssize_t>(first.size()), static_cast<py::ssize_t>(second.size())});
  std::int32_t* out = distances.mutable_data();
  py::gil_scoped_release release;
  for (const Descriptor& p : first) {
    for (const Descriptor& q : second) *out++ = hamming_distance(p, q);
  }
  return distances;
}

}  // namespace

void bind_features(py::module_& module) {
  bind_orb_options(module);
  bind_extraction(module);
  bind_extractor(module);
  module.def(
      "vector_units",
      [] {
        std::vector<std::string> names;
        for (const VectorUnit unit : vector_units()) names.emplace_back(name_of(unit));
        return names;
      },
      "Names of the vector units of this processor that have kernels, slowest first.");
  module.def("hamming_distances", &hamming_distances, py::arg("a"), py::arg("b"),
             "Number of differing bits row by row: (n, 32) and (n, 32) uint8 to (n,) int32.");
  module.def("hamming_matrix", &hamming_matrix, py::arg("a"), py::arg("b"),
             "Number of differing bits of all pairs: (n, 32) and (m, 32) uint8 to (n, m) int32.");
}

}  // namespace orbslam::bindings
