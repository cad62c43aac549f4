// SPDX-License-Identifier: BSD-3-Clause
// Copies of the map for users, viewers and writers; called by bind_map().
#include <pybind11/stl.h>

#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "map/snapshot.hpp"
#include "map/trajectory.hpp"

namespace orbslam::bindings {

void bind_map_snapshots(py::module_& module);

namespace {

using namespace py::literals;

template <class Row, class Item = typename Row::value_type>
py::array_t<Item> rows(const std::vector<Row>& values) {
  return copy_to_array<Item>(values.data(), {static_cast<py::ssize_t>(values.size()),
                                             static_cast<py::ssize_t>(Row().size())});
}

py::array_t<double> matrices(const std::vector<Matrix4>& values) {
  return copy_to_array<double>(values.data(), {static_cast<py::ssize_t>(values.size()), 4, 4});
}

py::array_t<bool> flags(const std::vector<std::uint8_t>& values) {
  return copy_to_array<bool>(values.data(), {static_cast<py::ssize_t>(values.size())});
}

void bind_snapshots(py::module_& module) {
  py::class_<KeyFrameSnapshot>(module, "KeyFrameSnapshot", "Published keyframes by ascending id.")
      .def_property_readonly(
          "ids", [](const KeyFrameSnapshot& self) { return to_array(self.ids); }, "(n,) int64.")
      .def_property_readonly(
          "T_wc", [](const KeyFrameSnapshot& self) { return matrices(self.T_wc); },
          "(n, 4, 4) float64, camera to world.")
      .def_property_readonly(
          "timestamps", [](const KeyFrameSnapshot& self) { return to_array(self.timestamps); },
          "(n,) float64, seconds.")
      .def_property_readonly(
          "parents", [](const KeyFrameSnapshot& self) { return to_array(self.parents); },
          "(n,) int64, -1 for the root.");
  py::class_<EdgeSnapshot>(module, "EdgeSnapshot", "Covisibility edges a < b.")
      .def_property_readonly(
          "a", [](const EdgeSnapshot& self) { return to_array(self.a); }, "(n,) int64.")
      .def_property_readonly(
          "b", [](const EdgeSnapshot& self) { return to_array(self.b); }, "(n,) int64.")
      .def_property_readonly(
          "weights", [](const EdgeSnapshot& self) { return to_array(self.weights); },
          "(n,) int32, shared points.");
  py::class_<PointSnapshot>(module, "PointSnapshot", "Points by ascending id.")
      .def_property_readonly(
          "ids", [](const PointSnapshot& self) { return to_array(self.ids); }, "(n,) int64.")
      .def_property_readonly(
          "positions", [](const PointSnapshot& self) { return rows(self.positions); },
          "(n, 3) float64, world.")
      .def_property_readonly(
          "observation_counts",
          [](const PointSnapshot& self) { return to_array(self.observation_counts); },
          "(n,) int32, 2 per observation with depth, else 1.");
  py::class_<ObservationSnapshot>(module, "ObservationSnapshot",
                                  "Observations of ids[i]: entries offsets[i]:offsets[i + 1].")
      .def_property_readonly(
          "ids", [](const ObservationSnapshot& self) { return to_array(self.ids); }, "(n,) int64.")
      .def_property_readonly(
          "offsets", [](const ObservationSnapshot& self) { return to_array(self.offsets); },
          "(n + 1,) int64.")
      .def_property_readonly(
          "keyframes", [](const ObservationSnapshot& self) { return to_array(self.keyframes); },
          "(m,) int64.")
      .def_property_readonly(
          "keypoints", [](const ObservationSnapshot& self) { return to_array(self.keypoints); },
          "(m,) int32, index of the keypoint in its keyframe.");
  py::class_<MapSnapshot>(module, "MapSnapshot", "Keyframes, loop edges and points at one moment.")
      .def_readonly("keyframes", &MapSnapshot::keyframes)
      .def_readonly("points", &MapSnapshot::points)
      .def_property_readonly(
          "loop_edges",
          [](const MapSnapshot& self) {
            const auto n = static_cast<py::ssize_t>(self.loop_a.size());
            py::array_t<std::int64_t> edges({n, py::ssize_t{2}});
            for (py::ssize_t i = 0; i < n; ++i) {
              edges.mutable_at(i, 0) = self.loop_a[static_cast<std::size_t>(i)].value;
              edges.mutable_at(i, 1) = self.loop_b[static_cast<std::size_t>(i)].value;
            }
            return edges;
          },
          "(n, 2) int64, ids of the keyframes that a closed loop connects, the lower one first.");
  module.def("snapshot_map", &snapshot_map, "map"_a, "which"_a = kNoMap, Release(),
             "Copy keyframes, loop edges and points in one consistent view, of a map (-1: the "
             "active one).");
  module.def(
      "snapshot_keyframes", &snapshot_keyframes, "map"_a, "which"_a = kNoMap, Release(),
      "Copy ids, poses, time stamps and parents of the keyframes, of a map (-1: the active one).");
  module.def(
      "snapshot_edges", &snapshot_edges, "map"_a,
      "min_weight"_a = static_cast<int>(Map::kCovisibilityThreshold), "which"_a = kNoMap, Release(),
      "Copy the covisibility edges with at least `min_weight` shared points, of a map (-1: the\n"
      "active one).");
  module.def(
      "snapshot_observations", &snapshot_observations, "map"_a, "which"_a = kNoMap, Release(),
      "Copy the observations of the points, as compressed rows, of a map (-1: the active one).");
}

void bind_trajectory(py::module_& module) {
  // "Trajectory" is the Python class that readers and writers use.
  py::class_<Trajectory>(module, "RecordedTrajectory", "Camera poses of all recorded frames.")
      .def_property_readonly(
          "timestamps", [](const Trajectory& self) { return to_array(self.timestamps); },
          "(n,) float64, seconds.")
      .def_property_readonly(
          "T_wc", [](const Trajectory& self) { return matrices(self.T_wc); },
          "(n, 4, 4) float64, camera to the frame of the map's root.")
      .def_property_readonly(
          "lost", [](const Trajectory& self) { return flags(self.lost); },
          "(n,) bool: tracking was lost, the pose repeats the last known one.")
      .def_property_readonly(
          "frames", [](const Trajectory& self) { return to_array(self.frames); },
          "(n,) int64, frame ids.");
  py::class_<TrajectoryRecorder>(module, "TrajectoryRecorder",
                                 "Remembers frames relative to their reference keyframes.")
      .def(py::init<>(), "Nothing recorded.")
      .def("__len__", &TrajectoryRecorder::size)
      .def("record", &TrajectoryRecorder::record, "map"_a, "frame"_a, "lost"_a, Release(),
           "Append a frame, or record it anew; without a pose it repeats the relative pose before.")
      .def("rebuild", &TrajectoryRecorder::rebuild, "map"_a, "which"_a = kNoMap, Release(),
           "All poses in a map (-1: the active one) from the present keyframe poses, anchored at\n"
           "its root.")
      .def("drop", &TrajectoryRecorder::drop, "map"_a, "which"_a, Release(),
           "Forget the frames of one map, which is about to be dropped.")
      .def(
          "entries",
          [](const TrajectoryRecorder& self) {
            const TrajectoryRecorder::Entries entries = self.entries();
            py::dict arrays;
            arrays["timestamps"] = to_array(entries.timestamps);
            arrays["frames"] = to_array(entries.frames);
            arrays["keyframes"] = to_array(entries.references);
            arrays["T_cr"] = rows(entries.T_cr);
            arrays["lost"] = flags(entries.lost);
            return arrays;
          },
          "All frames relative to their reference keyframes: arrays timestamps (n,) [s], frames\n"
          "(n,) ids, keyframes (n,) ids or -1, T_cr (n, 7): x, y, z, w of a unit quaternion, then\n"
          "the translation at the keyframe's first scale; lost (n,).")
      .def("clear", &TrajectoryRecorder::clear, "Forget all frames.")
      .def_property_readonly("n_bytes", &TrajectoryRecorder::n_bytes, "Allocated memory.");
}

}  // namespace

void bind_map_snapshots(py::module_& module) {
  bind_snapshots(module);
  bind_trajectory(module);
}

}  // namespace orbslam::bindings
