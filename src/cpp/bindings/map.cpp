// SPDX-License-Identifier: BSD-3-Clause
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <algorithm>

#include "bindings/arrays.hpp"
#include "bindings/bindings.hpp"
#include "map/anchor.hpp"
#include "map/content_hash.hpp"
#include "map/culling.hpp"
#include "map/invariants.hpp"
#include "map/keyframe_insertion.hpp"
#include "map/local_map.hpp"
#include "map/map_transform.hpp"
#include "map/scene_depth.hpp"
#include "map/sightings.hpp"

namespace orbslam::bindings {

void bind_map_snapshots(py::module_& module);  // map_snapshots.cpp
void bind_map_changes(py::module_& module);    // map_changes.cpp

namespace {

using namespace py::literals;

/// Points under probation. A class of its own, so that no list is converted per call.
struct RecentPoints {
  std::vector<MapPointId> ids;
};

// The GIL is given back before the map's lock is taken, so that a thread that waits for the map
// never keeps Python waiting.
template <class Query>
auto reading(const Map& map, Query&& query) {
  const py::gil_scoped_release release;
  const auto lock = map.read_lock();
  return query();
}

template <class Result, class... Args>
auto reader(Result (Map::*method)(Args...) const) {
  return [method](const Map& map, std::decay_t<Args>... args) {
    const auto lock = map.read_lock();
    return (map.*method)(args...);
  };
}

template <class Result, class... Args>
auto writer(Result (Map::*method)(Args...)) {
  return [method](Map& map, std::decay_t<Args>... args) {
    const auto lock = map.write_lock();
    return (map.*method)(args...);
  };
}

py::array_t<double> vectors(const std::vector<Eigen::Vector3d>& values) {
  return copy_to_array<double>(values.data(), {static_cast<py::ssize_t>(values.size()), 3});
}

const KeyFrame& living(const Map& map, KeyFrameId id) {
  const KeyFrame* keyframe = map.find(id);
  if (!keyframe) {
    throw py::key_error("keyframe " + std::to_string(id.value) + " is not in the map");
  }
  return *keyframe;
}

const MapPoint& living(const Map& map, MapPointId id) {
  const MapPoint* point = map.find(id);
  if (!point) throw py::key_error("map point " + std::to_string(id.value) + " is not in the map");
  return *point;
}

using MapClass = py::class_<Map, std::shared_ptr<Map>>;

void bind_queries(MapClass& map) {
  map.def_property_readonly("n_keyframes", py::cpp_function(reader(&Map::n_keyframes), Release()),
                            "Number of published keyframes, of all maps.")
      .def_property_readonly("n_points", py::cpp_function(reader(&Map::n_points), Release()),
                             "Number of living points.")
      .def_property_readonly("epoch", &Map::epoch, "Grows with clear(), after which ids restart.")
      .def_property_readonly("big_change_index", &Map::big_change_index,
                             "Grows when poses or points moved as a whole.")
      .def_property_readonly("structure_version", &Map::structure_version,
                             "Grows with every change of objects and observations.")
      .def_property_readonly("geometry_version", &Map::geometry_version,
                             "Grows with every change of a pose or a position.")
      .def(
          "keyframe_ids",
          [](const Map& self, MapIndex which) {
            return to_array(reading(self, [&] {
              std::vector<KeyFrameId> ids = self.keyframe_ids();
              if (which == kNoMap) return ids;
              const auto is_other = [&](KeyFrameId id) { return self.find(id)->map != which; };
              ids.erase(std::remove_if(ids.begin(), ids.end(), is_other), ids.end());
              return ids;
            }));
          },
          "map"_a = kNoMap,
          "Ids of the living keyframes of a map (-1: of all), ascending, unpublished ones\n"
          "included: (n,) int64.")
      .def(
          "point_ids",
          [](const Map& self) { return to_array(reading(self, [&] { return self.point_ids(); })); },
          "Ids of all living points, ascending: (n,) int64.")
      .def("resolve", reader(&Map::resolve), "id"_a, Release(),
           "The living point that replaced this one (or the point itself); -1 when it died.")
      .def("keyframe_pose", reader(&Map::T_cw), "id"_a, Release(),
           "T_cw of a keyframe, living or culled. Raises StateError for an unknown id.")
      .def(
          "keyframe_timestamp",
          [](const Map& self, KeyFrameId id) {
            const auto lock = self.read_lock();
            return living(self, id).frame->timestamp;
          },
          "id"_a, Release(), "Seconds, of a living keyframe.")
      .def(
          "keyframe_frame",
          [](const Map& self, KeyFrameId id) {
            const auto lock = self.read_lock();
            return std::const_pointer_cast<Frame>(living(self, id).frame);
          },
          "id"_a, Release(),
          "Measurements of a living keyframe: keypoints, descriptors, depths, colours, words.")
      .def(
          "frame_of",
          [](const Map& self, KeyFrameId id) {
            const auto lock = self.read_lock();
            const KeyFrame* keyframe = self.find(id);
            return keyframe ? keyframe->frame->id : FrameId{-1};
          },
          "id"_a, Release(), "The frame that a living keyframe was made of; -1 if it was culled.")
      .def("living", reader(&Map::living), "id"_a, Release(),
           "The keyframe itself, or the nearest of its ancestors that lives; -1 if unknown.")
      .def(
          "has_keyframe",
          [](const Map& self, KeyFrameId id) {
            const auto lock = self.read_lock();
            return self.find(id) != nullptr;
          },
          "id"_a, Release(), "Whether the keyframe is alive.")
      .def(
          "has_point",
          [](const Map& self, MapPointId id) {
            const auto lock = self.read_lock();
            return self.find(id) != nullptr;
          },
          "id"_a, Release(), "Whether the point is alive.")
      .def(
          "keyframe_points",
          [](const Map& self, KeyFrameId id) {
            return to_array(reading(self, [&] { return living(self, id).map_points; }));
          },
          "id"_a, "Point per keypoint of a living keyframe, -1 for none: (n,) int64.")
      .def(
          "parent",
          [](const Map& self, KeyFrameId id) {
            const auto lock = self.read_lock();
            return living(self, id).parent;
          },
          "id"_a, Release(), "Parent in the spanning tree, -1 for a root.")
      .def(
          "neighbours",
          [](const Map& self, KeyFrameId id) {
            return to_array(reading(self, [&] { return living(self, id).neighbours; }));
          },
          "id"_a, "Covisible keyframes by descending number of shared points: (n,) int64.")
      .def(
          "best_neighbours",
          [](const Map& self, KeyFrameId id, std::size_t n) {
            return to_array(reading(self, [&] { return self.best_neighbours(id, n); }));
          },
          "id"_a, "n"_a, "The first n neighbours, none of a culled keyframe: (<= n,) int64.")
      .def("weight", reader(&Map::weight), "a"_a, "b"_a, Release(),
           "Number of points that two keyframes share.")
      .def(
          "point_position",
          [](const Map& self, MapPointId id) -> Eigen::Vector3d {
            const auto lock = self.read_lock();
            return living(self, id).position;
          },
          "id"_a, Release(), "Position of a living point in the world: (3,) float64.")
      .def(
          "observation_count",
          [](const Map& self, MapPointId id) {
            const auto lock = self.read_lock();
            return living(self, id).observation_count;
          },
          "id"_a, Release(), "Weighted number of observations (2 with depth, else 1) of a point.")
      .def("content_hash", &content_hash, Release(),
           "64-bit hash over poses, points and observations: equal for equal maps.");
}

void bind_parts(MapClass& map) {
  map.def_property_readonly("active_map", &Map::active_map,
                            "The map that new keyframes belong to; the others rest.")
      .def_property_readonly("maps", py::cpp_function(reader(&Map::maps), Release()),
                             "The maps that hold keyframes, ascending: the oldest first.")
      .def(
          "map_of",
          [](const Map& self, KeyFrameId id) {
            const auto lock = self.read_lock();
            return self.map_of(id);
          },
          "keyframe"_a, Release(), "The map of a keyframe, living or culled; -1 if unknown.")
      .def(
          "map_of_point",
          [](const Map& self, MapPointId id) {
            const auto lock = self.read_lock();
            return self.map_of(id);
          },
          "point"_a, Release(), "The map of a living point, or of its successor; -1 if it died.")
      .def("root", reader(&Map::root), "map"_a, Release(),
           "The first keyframe of a map, -1 without keyframes; it never dies.")
      .def("n_keyframes_of", reader(&Map::n_keyframes_of), "map"_a, Release(),
           "Number of published keyframes of a map.")
      .def_property_readonly(
          "n_active_keyframes",
          [](const Map& self) {
            const py::gil_scoped_release release;
            const auto lock = self.read_lock();
            return self.n_keyframes_of(self.active_map());
          },
          "Number of published keyframes of the active map.")
      .def(
          "n_points_of",
          [](const Map& self, MapIndex which) {
            const auto lock = self.read_lock();
            std::size_t n = 0;
            self.for_each_point([&](const MapPoint& p) { n += self.is_in(p, which) ? 1 : 0; });
            return n;
          },
          "map"_a, Release(), "Number of living points of a map.")
      .def("is_upright", reader(&Map::is_upright), "map"_a, Release(),
           "Whether the third axis of the map's world is up, by an IMU, and its unit is the metre. "
           "Trajectories of other maps are relative to their first keyframe.")
      .def("set_upright", writer(&Map::set_upright), "map"_a, Release(),
           "Record that the map is upright.")
      .def("begin_map", writer(&Map::begin_map), Release(),
           "The next keyframe begins a map, which becomes the active one; its number. Nothing\n"
           "changes while the active one has no keyframe.")
      .def(
          "activate_map_of",
          [](Map& self, KeyFrameId id) {
            const auto lock = self.write_lock();
            const MapIndex found = self.map_of(id);
            self.activate_map(found);
            return found;
          },
          "keyframe"_a, Release(),
          "New keyframes belong to the map of a keyframe, living or culled; its number. Raises\n"
          "StateError if no map holds it.")
      .def(
          "erase_map",
          [](Map& self, MapIndex which) {
            std::vector<KeyFrameId> died;
            {
              const py::gil_scoped_release release;
              const auto lock = self.write_lock();
              died = self.erase_map(which);
            }
            return to_array(died);
          },
          "map"_a, "Drop a map with all that belongs to it; its keyframes: (n,) int64.")
      .def("join_maps", writer(&Map::join_maps), "child"_a, "parent"_a, Release(),
           "Move all objects of the map of one keyframe to the map of the other one.");
}

void bind_changes(MapClass& map) {
  map.def(
         "add_keyframe",
         [](Map& self, std::shared_ptr<Frame> frame, const Pose& T_cw) {
           const auto lock = self.write_lock();
           return self.add_keyframe(std::move(frame), T_cw);
         },
         "frame"_a.none(false), "T_cw"_a, Release(),
         "A new, unpublished keyframe with empty slots; its id.")
      .def("publish", writer(&Map::publish), "id"_a, Release(),
           "Make a keyframe part of the keyframe set.")
      .def("set_pose", writer(&Map::set_pose), "id"_a, "T_cw"_a, Release(),
           "Set T_cw of a living keyframe.")
      .def("erase_keyframe", writer(&Map::erase_keyframe), "id"_a, Release(),
           "Remove a keyframe. False, and only marked, while leases or loop edges protect it.")
      .def("begin_lease", writer(&Map::begin_lease), "id"_a, Release(),
           "Protect a keyframe from erase_keyframe(); counted.")
      .def(
          "end_lease", writer(&Map::end_lease), "id"_a, Release(),
          "End a protection; the last one carries out a deferred death, and then True is returned.")
      .def("add_loop_edge", writer(&Map::add_loop_edge), "a"_a, "b"_a, Release(),
           "Connect two keyframes by a loop edge; both are protected for ever.")
      .def("set_parent", writer(&Map::set_parent), "child"_a, "parent"_a, Release(),
           "Move a keyframe in the spanning tree. Raises StateError if that made a cycle.")
      .def("add_point", writer(&Map::add_point), "position"_a, "reference"_a, "first_frame"_a,
           Release(), "A new point without observations (world coordinates); its id.")
      .def("set_position", writer(&Map::set_position), "id"_a, "position"_a, Release(),
           "Move a living point (world coordinates).")
      .def("add_observation", writer(&Map::add_observation), "point"_a, "keyframe"_a, "index"_a,
           Release(), "Let a keyframe's keypoint observe a point, on both sides.")
      .def("erase_observation", writer(&Map::erase_observation), "point"_a, "keyframe"_a, Release(),
           "Remove an observation; the point dies at a weighted count of 2 or less.")
      .def("erase_point", writer(&Map::erase_point), "id"_a, Release(), "Remove a point.")
      .def("replace_point", writer(&Map::replace_point), "id"_a, "by"_a, Release(),
           "Merge a point into another one, which takes over its observations.")
      .def("update_point", writer(&Map::update_point), "id"_a, Release(),
           "Recompute descriptor, viewing direction and scale range of a point.")
      .def("update_connections", writer(&Map::update_connections), "id"_a, Release(),
           "Recount the points a keyframe shares with others.")
      .def("count_big_change", &Map::count_big_change, "Record that the whole map moved.")
      .def("clear", writer(&Map::clear), Release(), "Drop everything and start a new epoch.");
}

void bind_points(py::module_& module) {
  py::class_<PointBatch>(module, "PointBatch", "Copies of map points as flat arrays.")
      .def(py::init<>(), "An empty batch.")
      .def("__len__", &PointBatch::size)
      .def_property_readonly(
          "ids", [](const PointBatch& self) { return to_array(self.ids); }, "(n,) int64.")
      .def_property_readonly(
          "positions", [](const PointBatch& self) { return vectors(self.positions); },
          "(n, 3) float64, world.")
      .def_property_readonly(
          "mean_directions", [](const PointBatch& self) { return vectors(self.mean_directions); },
          "(n, 3) float64, mean unit vectors from the cameras to the point.")
      .def_property_readonly(
          "min_distances", [](const PointBatch& self) { return to_array(self.min_distances); },
          "(n,) float64, raw scale range in world units.")
      .def_property_readonly(
          "max_distances", [](const PointBatch& self) { return to_array(self.max_distances); },
          "(n,) float64, raw scale range in world units.")
      .def_property_readonly(
          "descriptors",
          [](const PointBatch& self) {
            return copy_to_array<std::uint8_t>(self.descriptors.data(),
                                               {static_cast<py::ssize_t>(self.size()), 32});
          },
          "(n, 32) uint8.");
  module.def(
      "gather_points",
      [](const Map& map, const IdArray& ids) {
        const auto wanted = to_point_ids(ids);
        const py::gil_scoped_release release;
        return gather_points(map, wanted);
      },
      "map"_a, "ids"_a, "The living points among `ids` ((n,) int64), in that order.");

  py::class_<RecentPoints>(module, "RecentPoints", "Points under probation, kept in C++.")
      .def(py::init<>(), "No points.")
      .def("__len__", [](const RecentPoints& self) { return self.ids.size(); })
      .def_property_readonly(
          "ids", [](const RecentPoints& self) { return to_array(self.ids); }, "(n,) int64.")
      .def(
          "extend",
          [](RecentPoints& self, const IdArray& ids) {
            const auto added = to_point_ids(ids);
            self.ids.insert(self.ids.end(), added.begin(), added.end());
          },
          "ids"_a, "Append points ((n,) int64).")
      .def(
          "clear", [](RecentPoints& self) { self.ids.clear(); }, "Forget all.");
}

void bind_local_map(py::module_& module) {
  py::class_<LocalMap>(module, "LocalMap", "The part of the map around the current frame.")
      .def_property_readonly(
          "keyframes", [](const LocalMap& self) { return to_array(self.keyframes); },
          "(n,) int64: voted ones by id, then those of the extension.")
      .def_readonly("points", &LocalMap::points, "All points of the local keyframes, each once.")
      .def_readonly("reference_keyframe", &LocalMap::reference_keyframe,
                    "Shares most points with the frame; -1 without votes.");
  module.def("anchor_frame", &anchor_frame, "map"_a, "frame"_a, "keyframe"_a, Release(),
             "Make a frame's pose relative to a keyframe (living or culled) as it is now.");
  module.def(
      "follow_map",
      [](const Map& map, TrackedFrame& frame) {
        FollowedMap followed;
        {
          const py::gil_scoped_release release;
          followed = follow_map(map, frame);
        }
        return py::make_tuple(std::move(followed.points), followed.stretched, followed.moved);
      },
      "map"_a, "frame"_a,
      "Bring an earlier frame up to date: its pose follows its keyframe, replaced points their\n"
      "successors, dead ones are dropped. Returns (PointBatch of the frame's points, by how much\n"
      "lengths around the frame have been multiplied since, motion of its pose `T_after @\n"
      "T_before^-1`). The motion is None without a pose, and where a loop has moved the map.");
  module.def(
      "transform_map",
      [](Map& map, MapIndex which, double scale, const Pose& pose) {
        transform_map(map, which, Similarity(scale, pose.rotation(), pose.translation()));
      },
      "map"_a, "which"_a, "scale"_a, "pose"_a, Release(),
      "Move all keyframes and points of a map: `x' = scale R x + t` with R, t of the pose. Counts "
      "as "
      "a big change; no other thread may work on the map.");
  module.def("select_local_map", &select_local_map, "map"_a, "frame"_a, Release(),
             "Keyframes voted for by the frame's points, extended, and all their points.");
  module.def(
      "count_sightings",
      [](const Map& map, const TrackedFrame& frame, const IdArray& in_view) {
        const auto seen = to_point_ids(in_view);
        const py::gil_scoped_release release;
        count_sightings(map, frame, seen);
      },
      "map"_a, "frame"_a, "in_view"_a,
      "Count which points were visible ((n,) int64 and the associated) and which were found.");
}

void bind_keyframe_verbs(py::module_& module) {
  module.def("insert_keyframe", &insert_keyframe, "map"_a, "frame"_a, "create_points"_a,
             "n_minimum"_a = kFewestDepthPoints, Release(),
             "Make a keyframe of a tracked frame, with points from its depths; its id.");
  module.def(
      "process_new_keyframe",
      [](Map& map, KeyFrameId id, RecentPoints& recent) {
        process_new_keyframe(map, id, recent.ids);
      },
      "map"_a, "id"_a, "recent"_a, Release(),
      "Add the observations of matched points, connect and publish the keyframe.");
  module.def("count_tracked_points", &count_tracked_points, "map"_a, "id"_a, "min_observations"_a,
             Release(), "Living points of a keyframe with at least so many observations.");
  module.def(
      "median_scene_depth",
      [](const Map& map, KeyFrameId id) {
        const auto lock = map.read_lock();
        return median_scene_depth(map, living(map, id));
      },
      "map"_a, "id"_a, Release(),
      "Lower median of the depths of a living keyframe's points; None without points.");
  module.def(
      "cull_recent_points",
      [](Map& map, KeyFrameId current, int min_observations, RecentPoints& recent) {
        return cull_recent_points(map, current, min_observations, recent.ids);
      },
      "map"_a, "current"_a, "min_observations"_a, "recent"_a, Release(),
      "Remove recent points that are rarely found; the number of points killed.");
  module.def("check_invariants", &check_invariants, "map"_a, "require_words"_a, Release(),
             "One sentence per violated invariant; empty for a consistent map.");
}

}  // namespace

void bind_map(py::module_& module) {
  MapClass map(module, "Map",
               "Owner of keyframes and points. Every method locks the map while it runs.");
  map.def(py::init<>(), "An empty map.");
  bind_queries(map);
  bind_parts(map);
  bind_changes(map);
  bind_points(module);
  bind_local_map(module);
  bind_keyframe_verbs(module);
  bind_map_snapshots(module);
  bind_map_changes(module);
}

}  // namespace orbslam::bindings
