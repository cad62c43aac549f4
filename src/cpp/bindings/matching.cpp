// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/stl.h>

#include "base/stop_flag.hpp"
#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "map/local_map.hpp"
#include "matching/by_projection.hpp"
#include "matching/by_words.hpp"
#include "matching/for_initialization.hpp"
#include "matching/for_triangulation.hpp"
#include "matching/fuse.hpp"
#include "matching/temporary_points.hpp"

namespace orbslam::bindings {
namespace {

using namespace py::literals;
using PositionArray = py::array_t<float, py::array::c_style | py::array::forcecast>;
using FeaturePairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

py::array_t<std::int64_t> to_pair_array(const FeaturePairs& pairs) {
  py::array_t<std::int64_t> array({static_cast<py::ssize_t>(pairs.size()), py::ssize_t{2}});
  auto view = array.mutable_unchecked<2>();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    view(static_cast<py::ssize_t>(i), 0) = pairs[i].first;
    view(static_cast<py::ssize_t>(i), 1) = pairs[i].second;
  }
  return array;
}

// Runs work without the GIL; arguments and results are converted with it.
template <class Work>
auto released(Work&& work) {
  const py::gil_scoped_release release;
  return work();
}

void bind_by_projection(py::module_& module) {
  module.def("match_last_frame", &match_last_frame, "current"_a, "last"_a, "points"_a, "radius"_a,
             "use_depth"_a, Release(),
             "Search the points of the last frame around their predicted positions.\n\n"
             "`current` needs a predicted T_cw; matches become its associations. `points` holds\n"
             "the last frame's points (gather_points). `radius`: pixels at level 0, times the\n"
             "keypoint's scale. `use_depth`: motion along the axis restricts the levels.\n"
             "Returns the number of matched keypoints. Raises StateError without poses.");

  module.def(
      "project_into",
      [](const TrackedFrame& frame, const PointBatch& points) {
        const auto views = released([&] { return project_into(frame, points); });
        const auto n = static_cast<py::ssize_t>(views.size());
        py::array_t<float> uvr({n, py::ssize_t{3}});
        py::array_t<float> cosine(n);
        py::array_t<std::int32_t> level(n);
        py::array_t<bool> visible(n);
        for (py::ssize_t i = 0; i < n; ++i) {
          const FrustumView& view = views[static_cast<std::size_t>(i)];
          uvr.mutable_at(i, 0) = view.u;
          uvr.mutable_at(i, 1) = view.v;
          uvr.mutable_at(i, 2) = view.right_u;
          cosine.mutable_at(i) = view.view_cosine;
          level.mutable_at(i) = view.level;
          visible.mutable_at(i) = view.visible;
        }
        return py::make_tuple(uvr, cosine, level, visible);
      },
      "frame"_a, "points"_a,
      "Frustum test of points at the frame's pose.\n\n"
      "Returns (uvr, view_cosine, level, visible): (n, 3) float32 pixels u, v and the column in\n"
      "the right image; (n,) float32; (n,) int32 predicted level; (n,) bool. The others are only\n"
      "meaningful where visible. Raises StateError without a pose.");

  py::class_<LocalMapMatches>(module, "LocalMapMatches", "Result of match_local_map().")
      .def_readonly("n_matches", &LocalMapMatches::n_matches, "Keypoints newly associated.")
      .def_property_readonly(
          "visible", [](const LocalMapMatches& self) { return to_array(self.visible); },
          "Points in view that were not associated before: (n,) int64.")
      .def("__repr__", [](const LocalMapMatches& self) {
        return "LocalMapMatches(n_matches=" + std::to_string(self.n_matches) +
               ", visible=" + std::to_string(self.visible.size()) + " points)";
      });

  module.def(
      "match_local_map",
      [](TrackedFrame& frame, const PointBatch& local_points, const IdArray& exclude,
         float radius_factor) {
        const auto excluded = to_point_ids(exclude);
        return released(
            [&] { return match_local_map(frame, local_points, excluded, radius_factor); });
      },
      "frame"_a, "local_points"_a, "exclude"_a, "radius_factor"_a,
      "Search the local map's points that the frame does not hold yet.\n\n"
      "`exclude`: (n,) int64 ids of points thrown out as outliers earlier in this frame.\n"
      "Earlier points have priority. Returns LocalMapMatches. Raises StateError without a pose.");

  module.def(
      "match_local_map",
      [](TrackedFrame& frame, const LocalMap& local_map, const IdArray& exclude,
         float radius_factor) {
        const auto excluded = to_point_ids(exclude);
        const std::size_t n_held = frame.n_associated();
        const LocalMapMatches matches = released(
            [&] { return match_local_map(frame, local_map.points, excluded, radius_factor); });
        return py::make_tuple(to_array(matches.visible), n_held + matches.visible.size());
      },
      "frame"_a, "local_map"_a, "exclude"_a, "radius_factor"_a,
      "The same with a LocalMap. Returns (points in view that were not associated before, (n,)\n"
      "int64; how many points should be in view, with those that were).");

  module.def(
      "match_keyframe_by_projection",
      [](const Map& map, KeyFrameId keyframe, TrackedFrame& frame, const IdArray& found,
         float radius_factor, int max_distance) {
        const auto ids = to_point_ids(found);
        return released([&] {
          return match_keyframe_by_projection(map, keyframe, frame, ids, radius_factor,
                                              max_distance);
        });
      },
      "map"_a, "keyframe"_a, "frame"_a, "found"_a, "radius_factor"_a, "max_distance"_a,
      "Search a keyframe's points that are not in `found` (ascending ids) in a frame with a pose.\n"
      "\n`max_distance`: most differing descriptor bits. Returns the number of new associations.");
}

void bind_by_words(py::module_& module) {
  module.def("match_keyframe_by_words", &match_keyframe_by_words, "map"_a, "keyframe"_a, "frame"_a,
             "ratio"_a, Release(),
             "Match a keyframe's points to a described frame under the same vocabulary nodes.\n\n"
             "Replaces the frame's associations; returns their number. `ratio`: best over second\n"
             "best distance must be less. Raises StateError without words.");
  module.def(
      "match_keyframe_by_descriptors", &match_keyframe_by_descriptors, "map"_a, "keyframe"_a,
      "frame"_a, "ratio"_a, Release(),
      "Match a keyframe's points to a frame, each compared with all of its keypoints.\n\n"
      "Matches are most alike on both sides. Otherwise as match_keyframe_by_words(); needs no\n"
      "words, and takes longer.");
  module.def(
      "match_keyframes_by_words",
      [](const Map& map, KeyFrameId a, KeyFrameId b, float ratio) {
        return to_pair_array(released([&] { return match_keyframes_by_words(map, a, b, ratio); }));
      },
      "map"_a, "a"_a, "b"_a, "ratio"_a,
      "Features of two keyframes that match by words and both have points.\n\n"
      "Returns (n, 2) int64: feature of a (ascending), feature of b.");
}

void bind_for_initialization(py::module_& module) {
  module.def(
      "match_views",
      [](const std::shared_ptr<Frame>& first, const std::shared_ptr<Frame>& current,
         const PositionArray& expected, float window, float ratio, int level_difference,
         int highest_level) {
        if (expected.ndim() != 2 || expected.shape(1) != 2) {
          throw py::value_error("expected must be an (n, 2) array of float32 pixels");
        }
        std::vector<Eigen::Vector2f> positions(static_cast<std::size_t>(expected.shape(0)));
        for (std::size_t i = 0; i < positions.size(); ++i) {
          positions[i] = {expected.data()[2 * i], expected.data()[2 * i + 1]};
        }
        const ViewMatchOptions options{window, ratio, level_difference, highest_level};
        const std::vector<int> matches =
            released([&] { return match_views(*first, *current, positions, options); });
        return copy_to_array<std::int32_t>(matches.data(),
                                           {static_cast<py::ssize_t>(matches.size())});
      },
      "first"_a.none(false), "current"_a.none(false), "expected"_a,
      "window"_a = ViewMatchOptions{}.window, "ratio"_a = ViewMatchOptions{}.ratio,
      "level_difference"_a = ViewMatchOptions{}.level_difference,
      "highest_level"_a = ViewMatchOptions{}.highest_level,
      "Search the keypoints of `first` up to a level in `current` around `expected`, (n, 2)\n"
      "pixels.\n\nReturns (n,) int32: index in `current` or -1.");
}

void bind_for_triangulation(py::module_& module) {
  py::class_<NewPointOptions>(module, "NewPointOptions", "Options of create_new_points().")
      .def(py::init([](bool monocular, std::size_t n_neighbours) {
             return NewPointOptions{monocular, n_neighbours};
           }),
           "monocular"_a = NewPointOptions().monocular,
           "n_neighbours"_a = NewPointOptions().n_neighbours)
      .def_readwrite("monocular", &NewPointOptions::monocular,
                     "The baseline is compared with the scene's depth, not with the rig's.")
      .def_readwrite("n_neighbours", &NewPointOptions::n_neighbours,
                     "Covisible keyframes to triangulate with; 20 for a single camera.");

  module.def(
      "create_new_points",
      [](Map& map, KeyFrameId current, const NewPointOptions& options,
         const std::shared_ptr<StopFlag>& should_stop) {
        const std::atomic<bool>* flag = should_stop ? &should_stop->value() : nullptr;
        return to_array(released([&] { return create_new_points(map, current, options, flag); }));
      },
      "map"_a, "current"_a, "options"_a, "should_stop"_a = py::none(),
      "Triangulate new points between a keyframe and its best neighbours.\n\n"
      "`should_stop`: a StopFlag read between neighbours, or None. Returns the new points' ids,\n"
      "(n,) int64.");
}

void bind_fuse(py::module_& module) {
  module.def("fuse_with_neighbours", &fuse_with_neighbours, "map"_a, "current"_a, "n_neighbours"_a,
             Release(),
             "Fuse a keyframe's points with those of its first and second neighbours, both ways;\n"
             "refresh its points and connections. Returns the number of changes.");
}

void bind_temporary_points(py::module_& module) {
  module.attr("FIRST_TEMPORARY_POINT") = kFirstTemporaryPoint.value;
  module.def(
      "add_temporary_points", &add_temporary_points, "last"_a, "points"_a,
      "n_minimum"_a = kFewestDepthPoints, Release(),
      "Give the last frame's depths without a map point temporary points (localization).\n\n"
      "All close ones, and far ones until `n_minimum` keypoints have been visited, nearest\n"
      "first. They are appended to `points` (gather_points of the last frame) and associated\n"
      "with `last`; temporary points left there are dropped first. Their ids start at\n"
      "FIRST_TEMPORARY_POINT. Returns the number made. Raises StateError without a pose.");
  module.def("discard_temporary", &discard_temporary, "frame"_a,
             "Drop the frame's associations with temporary points; their number.");
  module.def("count_map_points", &count_map_points, "frame"_a,
             "Number of associations with points of the map, not temporary, outliers included.");
}

}  // namespace

void bind_matching(py::module_& module) {
  bind_by_projection(module);
  bind_by_words(module);
  bind_for_initialization(module);
  bind_for_triangulation(module);
  bind_fuse(module);
  bind_temporary_points(module);
}

}  // namespace orbslam::bindings
