// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <memory>
#include <vector>

#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "frame/rig_frame.hpp"

namespace orbslam::bindings {
namespace {

/// None, or pixels of its own: level 0 of a pyramid outlives the arrays.
std::vector<cv::Mat> copies_of(const std::vector<py::object>& images, const char* name) {
  std::vector<cv::Mat> copies;
  for (const py::object& image : images) {
    copies.push_back(image.is_none() ? cv::Mat() : view_uint8(py::array(image), name).clone());
  }
  return copies;
}

}  // namespace

void bind_rig(py::module_& module) {
  py::class_<RigExtractor>(module, "RigExtractor",
                           "Extracts the images of a rig's cameras at the same time.")
      .def(py::init<const OrbOptions&, std::size_t>(), py::arg("options"), py::arg("n_cameras"))
      .def(
          "extract",
          [](RigExtractor& self, const std::vector<py::object>& images,
             const std::vector<py::object>& masks) {
            const std::vector<cv::Mat> pixels = copies_of(images, "image");
            const std::vector<cv::Mat> allowed = copies_of(masks, "mask");
            const py::gil_scoped_release release;
            return self.extract(pixels, allowed);
          },
          py::arg("images"), py::arg("masks"),
          "Extractions of grey images (h, w) uint8, in their order; None gives an empty one. A "
          "mask "
          "is None, or uint8 of the shape of its image with 0 where no keypoint may lie. One "
          "thread "
          "at a time.");
  module.def(
      "join_frames",
      [](const FrameContext& context, FrameId id, double timestamp,
         const std::vector<std::shared_ptr<Frame>>& frames) {
        return join_frames(context, id, timestamp, {frames.begin(), frames.end()});
      },
      py::arg("context"), py::arg("id"), py::arg("timestamp"), py::arg("frames"),
      py::call_guard<py::gil_scoped_release>(),
      "Frame of a rig from the frames of its cameras, in their order; None: that camera has none.\n"
      "The camera of the context is the rig.");
}

}  // namespace orbslam::bindings
