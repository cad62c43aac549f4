// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <string>

#include "map/changes.hpp"

namespace orbslam::testing {

/// For a map that outlives whoever holds the pointer.
inline std::shared_ptr<const Map> borrowed(const Map& map) {
  return {std::shared_ptr<const Map>(), &map};
}

/// A map that is known by its changes only.
struct MapMirror {
  struct KeyFrameRow {
    Matrix4 T_wc;
    double timestamp = 0;
    KeyFrameId parent;
    bool operator==(const KeyFrameRow& other) const {
      return T_wc == other.T_wc && timestamp == other.timestamp && parent == other.parent;
    }
  };
  struct PointRow {
    std::array<double, 3> position;
    std::int32_t observation_count = 0;
    bool operator==(const PointRow& other) const {
      return position == other.position && observation_count == other.observation_count;
    }
  };
  std::map<KeyFrameId, KeyFrameRow> keyframes;
  std::map<MapPointId, PointRow> points;
  KeyFramePairs covisibility, loop_edges, spanning_tree;
  std::string complaints;  ///< changes that cannot be applied

  void apply(const MapChanges& changes) {
    if (changes.restarted) *this = MapMirror();
    for (const KeyFrameId id : changes.keyframes_removed) {
      if (keyframes.erase(id) == 0) complaints += "an unknown keyframe was removed; ";
    }
    for (const MapPointId id : changes.points_removed) {
      if (points.erase(id) == 0) complaints += "an unknown point was removed; ";
    }
    const KeyFrameSnapshot& k = changes.keyframes_set;
    for (std::size_t i = 0; i < k.ids.size(); ++i) {
      keyframes[k.ids[i]] = {k.T_wc[i], k.timestamps[i], k.parents[i]};
    }
    const PointSnapshot& p = changes.points_set;
    for (std::size_t i = 0; i < p.ids.size(); ++i) {
      points[p.ids[i]] = {p.positions[i], p.observation_counts[i]};
    }
    if (changes.covisibility) covisibility = *changes.covisibility;
    if (changes.loop_edges) loop_edges = *changes.loop_edges;
    if (changes.spanning_tree) spanning_tree = *changes.spanning_tree;
  }

  /// What is not as in the map, in one text; empty when they are equal.
  std::string differences(const Map& map, int least_weight) const {
    MapChanges all;
    const MapSnapshot snapshot = snapshot_map(map);
    all.keyframes_set = snapshot.keyframes;
    all.points_set = snapshot.points;
    MapMirror expected;
    expected.apply(all);
    const auto is_published = [&](KeyFrameId id) { return expected.keyframes.count(id) > 0; };
    const EdgeSnapshot strong = snapshot_edges(map, least_weight);
    for (std::size_t i = 0; i < strong.a.size(); ++i) {
      expected.covisibility.push_back({strong.a[i], strong.b[i]});
    }
    for (std::size_t i = 0; i < snapshot.loop_a.size(); ++i) {
      if (!is_published(snapshot.loop_a[i]) || !is_published(snapshot.loop_b[i])) continue;
      expected.loop_edges.push_back({snapshot.loop_a[i], snapshot.loop_b[i]});
    }
    for (const auto& [id, row] : expected.keyframes) {
      if (is_published(row.parent)) expected.spanning_tree.push_back({id, row.parent});
    }
    std::string text = complaints;
    if (keyframes != expected.keyframes) text += "keyframes; ";
    if (points != expected.points) text += "points; ";
    if (covisibility != expected.covisibility) text += "covisibility; ";
    if (loop_edges != expected.loop_edges) text += "loop edges; ";
    if (spanning_tree != expected.spanning_tree) text += "spanning tree; ";
    return text;
  }
};

}  // namespace orbslam::testing
