// SPDX-License-Identifier: BSD-3-Clause
#include "frame/frame.hpp"

#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <optional>

#include "base/errors.hpp"
#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "frame/build_frame.hpp"
#include "frame/extract_pair.hpp"
#include "frame/image_input.hpp"
#include "frame/keypoint_colours.hpp"
#include "frame/right_alignment.hpp"
#include "frame/stereo_matching.hpp"

namespace orbslam::bindings {
namespace {

/// Contiguous, native byte order; copies only what is not.
py::array normal_form(const py::array& array) {
  py::array native = array;
  if (!array.dtype().attr("isnative").cast<bool>()) {
    native = array.attr("astype")(array.dtype().attr("newbyteorder")("=")).cast<py::array>();
  }
  return py::array::ensure(native, py::array::c_style);
}

/// A header over a (h, w) or (h, w, channels) array of OpenCV depth `depth`.
cv::Mat view_image(const py::array& array, int depth) {
  if (array.ndim() != 2 && array.ndim() != 3) {
    throw ImageError(
        "image must have the shape (height, width) or (height, width, channels), "
        "got " +
        std::to_string(array.ndim()) + " dimensions");
  }
  if (array.size() == 0) throw ImageError("image is empty; check that the file could be read");
  const auto channels = array.ndim() == 2 ? 1 : array.shape(2);
  if (channels > 4) {
    throw ImageError("image has " + std::to_string(channels) + " channels, at most 4 are possible");
  }
  return {static_cast<int>(array.shape(0)), static_cast<int>(array.shape(1)),
          CV_MAKETYPE(depth, static_cast<int>(channels)), const_cast<void*>(array.data())};
}

/// Empty for None; a copy of its own otherwise, which no Python thread can change.
cv::Mat copy_of_mask(const py::object& mask, const char* what) {
  if (mask.is_none()) return {};
  const cv::Mat copy = view_uint8(normal_form(py::array(mask)), what).clone();
  if (copy.empty()) throw ImageError(std::string(what) + " is empty; pass None");
  return copy;
}

template <class Item>
bool holds(const py::array& array) {
  return array.dtype().kind() == py::dtype::of<Item>().kind() &&
         array.itemsize() == static_cast<py::ssize_t>(sizeof(Item));
}

py::array grey_of(const py::array& image, bool is_rgb) {
  if (!holds<std::uint8_t>(image)) throw ImageError("image must be uint8 (8 bits per channel)");
  const py::array pixels = normal_form(image);
  const cv::Mat source = view_image(pixels, CV_8U);
  if (source.channels() == 1 && pixels.ndim() == 2) return pixels;
  py::array_t<std::uint8_t> result({source.rows, source.cols});
  cv::Mat grey(source.rows, source.cols, CV_8UC1, result.mutable_data());
  {
    const py::gil_scoped_release release;
    to_grey(source, is_rgb, grey);
  }
  return result;
}

// OpenCV's name of the item type; -1: it has none.
int opencv_depth(const py::array& array) {
  if (holds<std::uint8_t>(array)) return CV_8U;
  if (holds<std::int8_t>(array)) return CV_8S;
  if (holds<std::uint16_t>(array)) return CV_16U;
  if (holds<std::int16_t>(array)) return CV_16S;
  if (holds<std::int32_t>(array)) return CV_32S;
  if (holds<float>(array)) return CV_32F;
  if (holds<double>(array)) return CV_64F;
  return -1;
}

struct DepthView {
  py::array values;  ///< what the image is a header over
  cv::Mat image;
};

/// Of numbers of any kind; those that OpenCV does not know are copied.
DepthView view_depth(const py::array& raw) {
  py::array values = normal_form(raw);
  int depth = opencv_depth(values);
  if (depth < 0) {
    const char kind = values.dtype().kind();
    if (kind != 'u' && kind != 'i' && kind != 'f') {
      throw ImageError("depth image must be numeric, got " +
                       py::str(raw.dtype()).cast<std::string>());
    }
    values = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(values);
    depth = CV_64F;
  }
  cv::Mat image = view_image(values, depth);
  return {std::move(values), std::move(image)};
}

py::array depth_metres_of(const py::array& raw, double factor) {
  const DepthView view = view_depth(raw);
  const cv::Mat& source = view.image;
  py::array_t<float> result({source.rows, source.cols});
  cv::Mat metres(source.rows, source.cols, CV_32FC1, result.mutable_data());
  {
    const py::gil_scoped_release release;
    to_depth_metres(source, factor, metres);
  }
  return result;
}

py::array_t<float> positions_of(const std::vector<Keypoint>& keypoints) {
  py::array_t<float> array({static_cast<py::ssize_t>(keypoints.size()), py::ssize_t{2}});
  float* out = array.mutable_data();
  for (const Keypoint& keypoint : keypoints) {
    *out++ = keypoint.x;
    *out++ = keypoint.y;
  }
  return array;
}

template <class Item>
py::array_t<Item> field_of(const std::vector<Keypoint>& keypoints, Item Keypoint::*field) {
  py::array_t<Item> array(static_cast<py::ssize_t>(keypoints.size()));
  Item* out = array.mutable_data();
  for (const Keypoint& keypoint : keypoints) *out++ = keypoint.*field;
  return array;
}

std::size_t checked(const TrackedFrame& tracked, py::ssize_t i) {
  if (i < 0 || i >= static_cast<py::ssize_t>(tracked.map_points.size())) {
    throw py::index_error("keypoint index out of range");
  }
  return static_cast<std::size_t>(i);
}

void bind_frame_class(py::module_& module) {
  py::class_<Frame, std::shared_ptr<Frame>>(module, "Frame",
                                            "Measurements of one image (or pair): features, "
                                            "depths, words. Arrays are copies; n keypoints.")
      .def("__len__", &Frame::size)
      .def_property_readonly("size", &Frame::size, "Number n of keypoints.")
      .def_readonly("id", &Frame::id)
      .def_readonly("timestamp", &Frame::timestamp, "Seconds, as given by the caller.")
      .def_readonly("described", &Frame::described, "True once the words are computed.")
      .def_property_readonly(
          "camera", [](const Frame& f) { return std::const_pointer_cast<Camera>(f.camera); })
      .def_property_readonly(
          "keypoints", [](const Frame& f) { return positions_of(f.keypoints); },
          "(n, 2) float32, undistorted pixels.")
      .def_property_readonly(
          "raw_keypoints",
          [](const Frame& f) {
            return positions_of(f.raw_keypoints.empty() ? f.keypoints : f.raw_keypoints);
          },
          "(n, 2) float32, pixels of the image as it was given.")
      .def_property_readonly(
          "levels", [](const Frame& f) { return field_of(f.keypoints, &Keypoint::level); },
          "(n,) int32, pyramid levels.")
      .def_property_readonly(
          "sigma2",
          [](const Frame& f) {
            py::array_t<float> array(static_cast<py::ssize_t>(f.size()));
            for (std::size_t i = 0; i < f.size(); ++i) {
              array.mutable_at(static_cast<py::ssize_t>(i)) =
                  f.scales->sigma2(f.keypoints[i].level);
            }
            return array;
          },
          "(n,) float32, variance of the keypoints by their levels [px^2].")
      .def_property_readonly(
          "angles", [](const Frame& f) { return field_of(f.keypoints, &Keypoint::angle); },
          "(n,) float32, degrees in [0, 360).")
      .def_property_readonly(
          "descriptors",
          [](const Frame& f) {
            return copy_to_array<std::uint8_t>(f.descriptors.data(),
                                               {static_cast<py::ssize_t>(f.size()), 32});
          },
          "(n, 32) uint8.")
      .def_property_readonly(
          "right_u", [](const Frame& f) { return to_array(f.right_u); },
          "(n,) float32, column in the right image [px]; meaningful where depth > 0.")
      .def_property_readonly(
          "right_variance", [](const Frame& f) { return to_array(f.right_variance); },
          "(n,) float32, variance of right columns that were aligned, before the factor of the\n"
          "noise [px^2], 0 for others; (0,) where nothing was aligned.")
      .def_property_readonly(
          "has_images",
          [](const Frame& f) { return f.images != nullptr && f.images->get() != nullptr; },
          "Whether the frame still keeps its image pyramids.")
      .def_property_readonly(
          "depth", [](const Frame& f) { return to_array(f.depth); },
          "(n,) float32, metres; -1 when unknown.")
      .def_property_readonly(
          "colours",
          [](const Frame& f) {
            return copy_to_array<std::uint8_t>(f.colours.data(),
                                               {static_cast<py::ssize_t>(f.colours.size()), 3});
          },
          "(n, 3) uint8, red, green, blue of the image at the keypoints; (0, 3) of a grey image.")
      .def(
          "features_in_area",
          [](const Frame& f, float x, float y, float r, int min_level, int max_level) {
            std::vector<std::uint32_t> found;
            f.grid.features_in_area(f.keypoints, x, y, r, min_level, max_level, found);
            return to_array(found);
          },
          py::arg("x"), py::arg("y"), py::arg("r"), py::arg("min_level") = -1,
          py::arg("max_level") = -1,
          "Indices (uint32) of the keypoints less than r pixels away in both coordinates.");
}

void bind_tracked_frame(py::module_& module) {
  py::class_<TrackedFrame, std::shared_ptr<TrackedFrame>>(
      module, "TrackedFrame",
      "A frame with its pose and the map point of each keypoint, set by tracking. Arrays are "
      "copies.")
      .def(py::init([](const std::shared_ptr<Frame>& frame) { return TrackedFrame(frame); }),
           py::arg("features").none(false))
      .def_property_readonly(
          "features", [](const TrackedFrame& t) { return std::const_pointer_cast<Frame>(t.frame); },
          "Measurements: keypoints, descriptors and depths.")
      .def_property_readonly(
          "id", [](const TrackedFrame& t) { return t.frame->id; }, "Id of the frame.")
      .def_property_readonly(
          "timestamp", [](const TrackedFrame& t) { return t.frame->timestamp; },
          "Seconds, as given by the caller.")
      // A copy: what is read stays what it was when the frame follows the map.
      .def_property(
          "T_cw", [](const TrackedFrame& t) { return t.T_cw; },
          [](TrackedFrame& t, const std::optional<Pose>& T_cw) { t.T_cw = T_cw; },
          "World to camera; None while unknown.")
      .def_property_readonly("reference_keyframe", &TrackedFrame::reference_keyframe,
                             "The keyframe that the pose is relative to; -1: none.")
      .def(
          "share_anchor",
          [](TrackedFrame& t, const TrackedFrame& other) { t.anchor = other.anchor; },
          py::arg("other"), "The pose was predicted from that of another frame.")
      .def_property_readonly(
          "map_index", [](const TrackedFrame& t) { return t.anchor.map; },
          "The map that the pose belongs to; -1: none.")
      .def_property_readonly(
          "big_change", [](const TrackedFrame& t) { return t.anchor.big_change; },
          "Map.big_change_index of the map that the pose belongs to.")
      .def_property_readonly(
          "map_points", [](const TrackedFrame& t) { return to_array(t.map_points); },
          "(n,) int64, ids of the associated map points, -1: none.")
      .def_property_readonly(
          "aligned",
          [](const TrackedFrame& t) {
            py::array_t<bool> array(static_cast<py::ssize_t>(t.map_points.size()));
            for (std::size_t i = 0; i < t.map_points.size(); ++i) {
              array.mutable_at(static_cast<py::ssize_t>(i)) = t.aligned_at(i) != nullptr;
            }
            return array;
          },
          "(n,) bool, whether a keypoint's point is seen where its patch was aligned.")
      .def_property_readonly(
          "outlier",
          [](const TrackedFrame& t) {
            return copy_to_array<bool>(t.outlier.data(),
                                       {static_cast<py::ssize_t>(t.outlier.size())});
          },
          "(n,) bool, verdict of the last pose optimisation.")
      .def_property_readonly(
          "positions",
          [](const TrackedFrame& t) {
            return copy_to_array<double>(t.positions.data(),
                                         {static_cast<py::ssize_t>(t.positions.size()), 3});
          },
          "(n, 3) float64, world positions of the associated points at association time.")
      .def(
          "associate",
          [](TrackedFrame& t, py::ssize_t i, MapPointId point, const Eigen::Vector3d& position) {
            t.associate(checked(t, i), point, position);
          },
          py::arg("i"), py::arg("point"), py::arg("position"),
          "Associates keypoint i with a map point at a world position.")
      .def(
          "dissociate", [](TrackedFrame& t, py::ssize_t i) { t.dissociate(checked(t, i)); },
          py::arg("i"), "Removes the map point of keypoint i.")
      .def("clear_associations", &TrackedFrame::clear_associations,
           "Removes all map points, positions and outlier flags; keeps the pose.")
      .def(
          "pose_alone",
          [](const TrackedFrame& t) {
            TrackedFrame copy(t.frame);
            copy.T_cw = t.T_cw;
            copy.anchor = t.anchor;
            return copy;
          },
          "Another version of this frame with its pose, without associations.")
      .def(
          "take_over",
          [](TrackedFrame& t, const TrackedFrame& other) {
            if (other.frame != t.frame) {
              throw StateError("a pose can be taken over only from another version of the frame");
            }
            t = other;
          },
          py::arg("other"),
          "Take pose, anchor, associations and outlier flags of another version of this frame.\n"
          "Raises StateError when it is another frame.")
      .def(
          "copy_associations",
          [](TrackedFrame& t, const TrackedFrame& from, const py::array_t<bool>& keep) {
            if (keep.ndim() != 1) throw py::value_error("keep must be a 1-D array of bool");
            std::vector<std::uint8_t> flags(static_cast<std::size_t>(keep.size()));
            for (py::ssize_t i = 0; i < keep.size(); ++i) {
              flags[static_cast<std::size_t>(i)] = keep.at(i) ? 1 : 0;
            }
            t.copy_associations(from, flags);
          },
          py::arg("from_frame"), py::arg("keep"),
          "Takes over the associations of another version of the same frame where keep (n,) bool "
          "is true; drops all others. Raises StateError for another frame.")
      .def(
          "discard_outliers", [](TrackedFrame& t) { return to_array(t.discard_outliers()); },
          "Dissociates the outliers; ids (int64) of their points, ascending.")
      .def("n_associated", &TrackedFrame::n_associated,
           "Number of keypoints with a map point, outliers included.")
      .def("n_map_inliers", &TrackedFrame::n_map_inliers,
           "Number of inliers that are points of the map, not temporary ones.")
      .def(
          "n_close_tracked_untracked",
          [](const TrackedFrame& t) {
            const CloseCounts counts = t.n_close_tracked_untracked();
            return py::make_tuple(counts.tracked, counts.untracked);
          },
          "(with, without) an inlier map point, over the close keypoints.");
}

void bind_builders(py::module_& module) {
  // ScalePyramid is copied: a small table, and Python's object need not be a shared one.
  py::class_<FrameContext>(module, "FrameContext",
                           "Camera and parameters that all frames of one system share.")
      .def(py::init([](const std::shared_ptr<Camera>& camera, const ScalePyramid& scales) {
             return FrameContext{camera, std::make_shared<ScalePyramid>(scales)};
           }),
           py::arg("camera").none(false), py::arg("scales"))
      .def_property_readonly(
          "camera", [](const FrameContext& c) { return std::const_pointer_cast<Camera>(c.camera); })
      .def_property_readonly("scales", [](const FrameContext& c) { return *c.scales; });

  module.def(
      "build_monocular_frame",
      [](const FrameContext& context, FrameId id, double timestamp, const Extraction& extraction) {
        return build_monocular_frame(context, id, timestamp, extraction.features);
      },
      py::arg("context"), py::arg("id"), py::arg("timestamp"), py::arg("extraction"),
      py::call_guard<py::gil_scoped_release>(),
      "Frame of a single camera: undistorted keypoints, no depth.");
  module.def("build_stereo_frame", &build_stereo_frame, py::arg("context"), py::arg("id"),
             py::arg("timestamp"), py::arg("left"), py::arg("right"),
             py::call_guard<py::gil_scoped_release>(),
             "Frame of a rectified pair with depth by stereo matching.");
  module.def("build_wide_stereo_frame", &build_wide_stereo_frame, py::arg("context"),
             py::arg("pair"), py::arg("id"), py::arg("timestamp"), py::arg("left"),
             py::arg("right"), py::call_guard<py::gil_scoped_release>(),
             "Frame of a fisheye pair with depth along the rays; the camera of the context is the "
             "left one of the pair.");
  module.def(
      "build_rgbd_frame",
      [](const FrameContext& context, FrameId id, double timestamp, const Extraction& extraction,
         const py::array& depth, double factor) {
        const DepthView raw = view_depth(depth);
        const py::gil_scoped_release release;
        return build_rgbd_frame(context, id, timestamp, extraction.features, raw.image, factor);
      },
      py::arg("context"), py::arg("id"), py::arg("timestamp"), py::arg("extraction"),
      py::arg("depth"), py::arg("factor") = 1.0,
      "Frame of an image with registered depth (h, w), any kind of number: raw / factor is metres; "
      "<= 0, NaN and inf: none. Raises ImageError when the depth image has another size or is not "
      "numeric, SettingsError for a negative factor.");
}

}  // namespace

void bind_frame(py::module_& module) {
  bind_frame_class(module);
  bind_tracked_frame(module);
  bind_builders(module);

  module.def(
      "match_stereo",
      [](const Extraction& left, const Extraction& right, const ScalePyramid& scales, double bf,
         double max_disparity) {
        StereoMatches matches;
        {
          const py::gil_scoped_release release;
          matches = match_stereo(left, right, scales, bf, max_disparity);
        }
        return py::make_tuple(to_array(matches.right_u), to_array(matches.depth));
      },
      py::arg("left"), py::arg("right"), py::arg("scales"), py::arg("bf"), py::arg("max_disparity"),
      "(right_u [px], depth [m]) of the left keypoints, float32, -1: none. bf in px m, "
      "max_disparity in px.");

  py::class_<PairExtractor>(module, "PairExtractor",
                            "Extracts left and right images at the same time, in two threads.")
      .def(py::init<const OrbOptions&>(), py::arg("options"))
      .def(
          "extract",
          [](PairExtractor& self, const py::array& left, const py::array& right,
             const py::object& left_mask, const py::object& right_mask) {
            // Level 0 of a pyramid shares the image's pixels and outlives the arrays: copy them.
            const cv::Mat left_pixels = view_uint8(left, "left image").clone();
            const cv::Mat right_pixels = view_uint8(right, "right image").clone();
            const cv::Mat left_allowed = copy_of_mask(left_mask, "left mask");
            const cv::Mat right_allowed = copy_of_mask(right_mask, "right mask");
            const py::gil_scoped_release release;
            return self.extract(left_pixels, right_pixels, left_allowed, right_allowed);
          },
          py::arg("left"), py::arg("right"), py::arg("left_mask") = py::none(),
          py::arg("right_mask") = py::none(),
          "Extractions (left, right) of two grey images (h, w) uint8 of one size. A mask is None, "
          "or uint8 of the same shape with 0 where no keypoint may lie. Raises ImageError for "
          "anything else, StateError while another thread uses this object.");

  module.def("to_grey", &grey_of, py::arg("image"), py::arg("is_rgb"),
             "Grey image (h, w) uint8 of a grey, colour (h, w, 3) or colour + alpha (h, w, 4) "
             "image; a contiguous grey image comes back itself.");
  module.def(
      "keep_pixels",
      [](Frame& frame, const py::array& image, bool is_rgb, const std::optional<py::array>& grey,
         const Extraction* left, const Extraction* right, const PairRectifier* rectifier) {
        const py::array grey_image = grey.value_or(image);
        if (!holds<std::uint8_t>(image) || !holds<std::uint8_t>(grey_image)) {
          throw ImageError("image must be uint8");
        }
        const py::array pixels = normal_form(image), grey_pixels = normal_form(grey_image);
        const cv::Mat source = view_image(pixels, CV_8U), whole = view_image(grey_pixels, CV_8U);
        const py::gil_scoped_release release;
        if (grey) frame.small_image = shrink_image(whole);
        if (source.channels() > 1) {
          sample_colours(source, is_rgb, frame, rectifier ? &rectifier->left() : nullptr);
        }
        if (left == nullptr) return;
        FrameImages::Pyramids images{left->pyramid, {}};
        if (right != nullptr) images.right = right->pyramid;
        frame.images = std::make_shared<FrameImages>(std::move(images));
      },
      py::arg("frame"), py::arg("image"), py::arg("is_rgb"),
      py::arg("grey").none(true) = py::none(), py::arg("left").none(true) = py::none(),
      py::arg("right").none(true) = py::none(), py::arg("rectifier").none(true) = py::none(),
      "Keep the data of a new frame's image that later steps need.\n\n"
      "Its colours at the keypoints, of an image (h, w, 3) or (h, w, 4) uint8; with the rectifier\n"
      "of a raw pair it is the raw left one. Where given, the grey image (h, w) uint8, shrunk to\n"
      "some 1500 pixels, for align_rotation(), and the image pyramids of `left` and `right`, in\n"
      "which patches are aligned. Raises ImageError for images of another size or kind.");
  module.def(
      "release_images",
      [](const Frame& frame) {
        if (frame.images) frame.images->release();
      },
      py::arg("frame"), "Give up the image pyramids of a frame.");
  module.def(
      "align_right_columns",
      [](Frame& frame) {
        const Camera& camera = *frame.camera;
        return align_right_columns(frame, camera.bf(), camera.pinhole().fx);
      },
      py::arg("frame"), py::call_guard<py::gil_scoped_release>(),
      "Align the right image of a new stereo frame, which keeps its images, to the left one at\n"
      "every keypoint with a depth. Returns how many were aligned.");
  module.def("to_depth_metres", &depth_metres_of, py::arg("raw"), py::arg("factor"),
             "Depth (h, w) float32 in metres: raw / factor. Values <= 0 and NaN mean none.");
}

}  // namespace orbslam::bindings
