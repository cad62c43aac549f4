// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <tuple>

#include "alignment/align_patch.hpp"
#include "base/errors.hpp"
#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "bindings/stop_flag.hpp"
#include "optimize/frame_alignment.hpp"
#include "optimize/keyframe_alignment.hpp"
#include "optimize/point_following.hpp"
#include "optimize/sighting_alignment.hpp"

namespace orbslam::bindings {
namespace {

using namespace py::literals;

void bind_failures(py::module_& module) {
  py::enum_<AlignmentFailure>(module, "AlignmentFailure", "Why a patch was not aligned.")
      .value("NONE", AlignmentFailure::kNone, "It was.")
      .value("OUTSIDE", AlignmentFailure::kOutside,
             "Patch or image do not reach that far, or a number is not finite.")
      .value("FLAT", AlignmentFailure::kFlat, "No texture, or texture in one direction only.")
      .value("NOT_CONVERGED", AlignmentFailure::kNotConverged,
             "It moved too far, or did not converge.")
      .value("LOW_CORRELATION", AlignmentFailure::kLowCorrelation,
             "It converged where the grey values do not agree.");
  py::class_<AlignmentOptions>(module, "AlignmentOptions", "How align_patch works.")
      .def(py::init([](int iterations, double max_shift, double min_correlation, double converged) {
             return AlignmentOptions{iterations, max_shift, min_correlation, converged};
           }),
           "iterations"_a = AlignmentOptions().iterations,
           "max_shift"_a = AlignmentOptions().max_shift,
           "min_correlation"_a = AlignmentOptions().min_correlation,
           "converged"_a = AlignmentOptions().converged)
      .def_readonly("iterations", &AlignmentOptions::iterations, "Steps at most.")
      .def_readonly("max_shift", &AlignmentOptions::max_shift,
                    "From the start, pixels of the level; at most 4.")
      .def_readonly("min_correlation", &AlignmentOptions::min_correlation,
                    "Of the grey values, 0 to 1.")
      .def_readonly("converged", &AlignmentOptions::converged,
                    "A step shorter than that is the last one, pixels.");
}

void bind_patch(py::module_& module) {
  py::class_<PatchAlignment>(module, "PatchAlignment", "What align_patch found.")
      .def_property_readonly("ok", &PatchAlignment::ok, "It was aligned.")
      .def_readonly("failure", &PatchAlignment::failure, "Why not.")
      .def_readonly("iterations", &PatchAlignment::iterations, "Steps.")
      .def_readonly("position", &PatchAlignment::position, "(2,) pixels of the image.")
      .def_readonly("information", &PatchAlignment::information,
                    "(2, 2) inverse covariance of the position, pixels^-2.")
      .def_readonly("correlation", &PatchAlignment::correlation, "Of the grey values, -1 to 1.")
      .def_readonly("gain", &PatchAlignment::gain,
                    "Contrast of the image over that of the reference.");
  module.def(
      "align_patch",
      [](const py::array& reference, const Eigen::Vector2d& position, const Eigen::Matrix2d& A,
         const py::array& image, const Eigen::Vector2d& start, const AlignmentOptions& options) {
        const cv::Mat from = view_uint8(reference, "the reference"),
                      to = view_uint8(image, "the image");
        const py::gil_scoped_release release;
        ReferencePatch patch;
        if (!cut_patch(from, position, patch)) return PatchAlignment();
        return align_patch(patch, A, to, start, options);
      },
      "reference"_a, "position"_a, "A"_a, "image"_a, "start"_a,
      py::arg_v("options", AlignmentOptions(), "AlignmentOptions()"),
      "Move the 9 x 9 patch at `position` of an image over another one until the grey values\n"
      "agree, but for gain and offset. Images: uint8 (h, w). `A`: (2, 2), maps pixels around\n"
      "`position` to pixels around `start`. Returns a PatchAlignment.");
}

cv::Mat image_or_none(const py::object& image, const char* what) {
  return image.is_none() ? cv::Mat() : view_uint8(py::array(image), what);
}

void bind_steps(py::class_<SightingAlignment>& type) {
  type.def(
          "take_references",
          [](SightingAlignment& alignment, KeyFrameId keyframe, const py::array& image) {
            const cv::Mat grey = view_uint8(image, "the image");
            const py::gil_scoped_release release;
            alignment.take_references(keyframe, grey);
          },
          "keyframe"_a, "image"_a,
          "Keep the patches of reference sightings in a keyframe. `image`: uint8 (h, w), as the\n"
          "camera took it. Raises StateError for an unknown keyframe, ImageError for an image of\n"
          "another size.")
      .def("begin_round", &SightingAlignment::begin_round, Release(),
           "Forget the last round; compute patches by the present poses.")
      .def(
          "align",
          [](SightingAlignment& alignment, KeyFrameId keyframe, const py::array& image,
             const py::object& right) {
            const cv::Mat grey = view_uint8(image, "the image");
            const cv::Mat other = image_or_none(right, "the right image");
            const py::gil_scoped_release release;
            alignment.align(keyframe, grey, other);
          },
          "keyframe"_a, "image"_a, "right"_a = py::none(),
          "Align the sightings in a keyframe, and in the right image of a rectified pair.")
      .def("weigh", &SightingAlignment::weigh, Release(),
           "Put positions and weights of aligned sightings into the bundle.")
      .def(
          "solve",
          [](SightingAlignment& alignment, const FullBundleOptions& options,
             const std::shared_ptr<StopFlag>& abort,
             int n_threads) { return alignment.solve(options, flag_of(abort), n_threads); },
          py::arg_v("options", FullBundleOptions(), "FullBundleOptions()"), "abort"_a = py::none(),
          "n_threads"_a = 1, Release(), "Adjust; returns a BundleSummary.")
      .def("commit", &SightingAlignment::commit, "map"_a, Release(),
           "Move the map to the result; returns a FullBundleCommit.");
}

void bind_sightings(py::module_& module) {
  py::class_<AlignmentNoise>(module, "AlignmentNoise", "Noise of aligned sightings.")
      .def_readonly("factor", &AlignmentNoise::factor,
                    "Standard deviation over that which the patches give.")
      .def_readonly("deviation", &AlignmentNoise::deviation,
                    "Median standard deviation, so scaled, pixels of the level.");
  py::class_<SightingAlignment> type(
      module, "SightingAlignment",
      "Full bundle adjustment with sightings that are aligned to each other.\n\n"
      "Order: take_references() for all images; then rounds of begin_round(), align() for all\n"
      "images, weigh() and solve(); at last commit(). The map must not change meanwhile.");
  type.def(py::init<const Map&, MapIndex, AlignmentOptions>(), "map"_a, "which"_a = kNoMap,
           py::arg_v("options", AlignmentOptions(), "AlignmentOptions()"), Release());
  bind_steps(type);
  type.def_property_readonly(
          "keyframes", [](const SightingAlignment& a) { return to_array(a.keyframes()); },
          "(k,) ids of the keyframes whose images are wanted.")
      .def_property_readonly(
          "n_points", [](const SightingAlignment& a) { return a.bundle().points.size(); },
          "Points.")
      .def_property_readonly(
          "n_observations",
          [](const SightingAlignment& a) { return a.bundle().problem.observations.size(); },
          "Observations.")
      .def_property_readonly("counts", &SightingAlignment::counts,
                             "Sightings tried in this round by AlignmentFailure; 0: aligned.")
      .def_property_readonly("right_counts", &SightingAlignment::right_counts,
                             "The same of columns in right images.")
      .def_property_readonly("noise", &SightingAlignment::noise, "Of aligned sightings.")
      .def_property_readonly("right_noise", &SightingAlignment::right_noise,
                             "Of columns in right images.")
      .def_property_readonly("median_error", &SightingAlignment::median_error,
                             "Median distance between sightings and points, pixels.");
}

void bind_followed_points(py::module_& module) {
  py::class_<FollowedPoints>(module, "FollowedPoints",
                             "Points of an earlier frame, found in another image by their patches.")
      .def("__len__", [](const FollowedPoints& self) { return self.points.size(); })
      .def_readonly("extraction", &FollowedPoints::extraction,
                    "One keypoint a point, with its descriptor, and the pyramid of the image.")
      .def_readonly("T_cw", &FollowedPoints::T_cw, "Pose; None: too few points were found.")
      .def_readonly("n_patches", &FollowedPoints::n_patches,
                    "Inliers of the earlier frame that have a patch.")
      .def_readonly("n_in_view", &FollowedPoints::n_in_view,
                    "Of these, points that the pose puts into the image.");
  module.def(
      "follow_points",
      [](const Map& map, const FrameContext& context, const TrackedFrame& earlier, const Pose& T_cw,
         const py::array& grey) {
        // The pyramid shares the pixels.
        const cv::Mat image = view_uint8(grey, "the image").clone();
        const py::gil_scoped_release release;
        return follow_points(map, context, earlier, T_cw, image);
      },
      "map"_a, "context"_a, "earlier"_a, "T_cw"_a, "grey"_a,
      "Look for the inliers of an earlier frame in a grey image (h, w) uint8 by their patches,\n"
      "around the predicted pose. Raises ImageError for anything but a grey image.");
  module.def(
      "associate_followed", &associate, "map"_a, "frame"_a, "followed"_a,
      "Associate a frame that was built of the features of these points with them, and give\n"
      "it their pose. Raises StateError for another frame, and where there is no pose.");
}

void bind_map_alignment(py::module_& module) {
  module.def(
      "align_keyframes",
      [](Map& map, KeyFrameId keyframe, bool patches_only, int n_threads) {
        const KeyframeAlignment done = align_keyframes(map, keyframe, patches_only, n_threads);
        return std::make_pair(done.n_patches, done.counts);
      },
      "map"_a, "keyframe"_a, "patches_only"_a = false, "n_threads"_a = 1, Release(),
      "Align sightings to the patches of their points, in a new keyframe and in its neighbours\n"
      "that keep their images; cut the patches that are missing. Returns\n"
      "(number of new patches, sightings tried by AlignmentFailure).");
  module.def("align_frame", &align_frame, "map"_a, "frame"_a, "most"_a, Release(),
             "Align at most `most` inliers of a tracked frame for optimize_pose(). Returns the\n"
             "sightings tried by AlignmentFailure.");
  bind_followed_points(module);
  module.def(
      "optimize_aligned",
      [](const Map& map, TrackedFrame& frame, std::size_t most, int fewest) {
        PoseEstimate estimate;
        {
          const py::gil_scoped_release release;
          estimate = optimize_aligned(map, frame, most, fewest);
        }
        return std::make_tuple(estimate.n_inliers, frame.n_associated(), frame.n_map_inliers(),
                               estimate.covariance);
      },
      "map"_a, "frame"_a, "most"_a, "fewest"_a,
      "optimize_pose(), and once more with at most `most` aligned inliers (align_frame) where the\n"
      "pose has at least `fewest`; `most` 0: without. Returns (inliers, matches, inliers on "
      "points\n"
      "of the map, covariance (6, 6)). Raises StateError without a pose.");
  module.def(
      "alignment_noise",
      [](const Map& map) {
        return std::make_pair(map.noise().position.value(), map.noise().right.value());
      },
      "map"_a,
      "Factors on the standard deviations that patches give: (positions, right columns), as the\n"
      "map's adjustments have measured them.");
  module.def(
      "count_aligned",
      [](const Map& map) {
        const auto lock = map.read_lock();
        std::size_t n = 0;
        map.for_each_point([&](const MapPoint& point) {
          for (const Observation& o : point.observations) {
            n += map.find(o.keyframe)->aligned_at(o.index, point.id) != nullptr ? 1 : 0;
          }
        });
        return n;
      },
      "map"_a, Release(), "Number of sightings that are aligned.");
}

}  // namespace

void bind_alignment(py::module_& module) {
  bind_failures(module);
  bind_patch(module);
  bind_sightings(module);
  bind_map_alignment(module);
}

}  // namespace orbslam::bindings
