// SPDX-License-Identifier: BSD-3-Clause
// What has changed in the map, for viewers and writers; called by bind_map().
#include <pybind11/stl.h>

#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "map/changed_ids.hpp"
#include "map/changes.hpp"

namespace orbslam::bindings {

void bind_map_changes(py::module_& module);

namespace {

using namespace py::literals;

using PairArray = py::array_t<std::int64_t>;

std::optional<PairArray> pairs(const std::optional<KeyFramePairs>& values) {
  if (!values) return std::nullopt;
  return copy_to_array<std::int64_t>(values->data(), {static_cast<py::ssize_t>(values->size()), 2});
}

void bind_follower(py::module_& module) {
  py::class_<MapChanges>(module, "MapChanges",
                         "The changes from an earlier state of a map to a later one.")
      .def_readonly("map", &MapChanges::map, "Which map it is.")
      .def_readonly("restarted", &MapChanges::restarted, "All earlier reports are void.")
      .def_readonly("keyframes_set", &MapChanges::keyframes_set, "New and changed keyframes.")
      .def_property_readonly(
          "keyframes_removed",
          [](const MapChanges& self) { return to_array(self.keyframes_removed); },
          "(n,) int64, of those reported before.")
      .def_readonly("points_set", &MapChanges::points_set, "New and changed points.")
      .def_property_readonly(
          "points_removed", [](const MapChanges& self) { return to_array(self.points_removed); },
          "(n,) int64, of those reported before.")
      .def_property_readonly(
          "covisibility", [](const MapChanges& self) { return pairs(self.covisibility); },
          "(n, 2) int64, all pairs, the lower id first; None if they are as before.")
      .def_property_readonly(
          "loop_edges", [](const MapChanges& self) { return pairs(self.loop_edges); },
          "(n, 2) int64, all pairs, the lower id first; None if they are as before.")
      .def_property_readonly(
          "spanning_tree", [](const MapChanges& self) { return pairs(self.spanning_tree); },
          "(n, 2) int64, all pairs of keyframe and parent; None if they are as before.");
  py::class_<MapFollower>(module, "MapFollower",
                          "Reports the changes of a map since the last call.")
      .def(
          py::init([](const std::shared_ptr<Map>& map, int least_weight, MapIndex which) {
            return std::make_unique<MapFollower>(map, least_weight, which);
          }),
          "map"_a.none(false), "least_weight"_a = static_cast<int>(Map::kEssentialWeight),
          "which"_a = kNoMap,
          "`least_weight`: least number of shared points of a reported covisibility edge. `which`: "
          "the\n"
          "map that is followed; -1: the map that is active at each call.")
      .def("update", &MapFollower::update, Release(),
           "All changes since the last call, in one consistent view.");
}

void bind_stamps(py::module_& module) {
  py::class_<MapStamp>(module, "MapStamp",
                       "A state of a map, identified by the number of its last change.")
      .def(py::init<>(), "Before everything.")
      .def(
          "__eq__", [](const MapStamp& a, const MapStamp& b) { return a == b; }, py::is_operator());
  py::class_<ChangedIds>(module, "ChangedIds", "Ascending ids of changed objects.")
      .def_readonly("stamp", &ChangedIds::stamp, "The state of the answer.")
      .def_readonly("restarted", &ChangedIds::restarted,
                    "The map was cleared since; all living objects are listed.")
      .def_property_readonly(
          "keyframes", [](const ChangedIds& self) { return to_array(self.keyframes); },
          "(n,) int64, those that live, unpublished ones included.")
      .def_property_readonly(
          "keyframes_removed",
          [](const ChangedIds& self) { return to_array(self.keyframes_removed); },
          "(n,) int64; may include objects that were created and removed in between, and unused "
          "ids.")
      .def_property_readonly(
          "points", [](const ChangedIds& self) { return to_array(self.points); },
          "(n,) int64, those that live.")
      .def_property_readonly(
          "points_removed", [](const ChangedIds& self) { return to_array(self.points_removed); },
          "(n,) int64; may include objects that were created and removed in between, and unused "
          "ids.");
  module.def("stamp_of", &stamp_of, "map"_a, Release(), "The present moment.");
  module.def("changed_since", &changed_since, "map"_a, "since"_a, Release(),
             "Keyframes and points that have changed since a state of the map; all for a default\n"
             "MapStamp(). The counters of the tracker do not count as changes.");
}

}  // namespace

void bind_map_changes(py::module_& module) {
  bind_follower(module);
  bind_stamps(module);
}

}  // namespace orbslam::bindings
