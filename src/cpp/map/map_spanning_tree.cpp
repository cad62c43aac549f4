// SPDX-License-Identifier: BSD-3-Clause
// Map: spanning tree, loop edges and the death of keyframes.
#include <algorithm>
#include <string>

#include "base/errors.hpp"
#include "map/map.hpp"

namespace orbslam {

bool Map::is_in_subtree(KeyFrameId id, KeyFrameId root) const {
  for (const KeyFrame* at = find(id); at; at = find(at->parent)) {
    if (at->id == root) return true;
  }
  return false;
}

void Map::link(KeyFrame& child, KeyFrameId parent) {
  if (KeyFrame* old = keyframes_.find(child.parent)) old->children.erase(child.id);
  keyframe(parent).children.insert(child.id);
  child.parent = parent;
  child.provisional_parent = false;
  keyframes_.touch(child.id);
  ++structure_version_;
}

void Map::set_parent(KeyFrameId child, KeyFrameId parent) {
  KeyFrame& moved = keyframe(child);
  keyframe(parent);
  if (is_root(moved)) {
    throw StateError("keyframe " + std::to_string(child.value) +
                     " is the root of the spanning tree");
  }
  if (is_in_subtree(parent, child)) {
    throw StateError("keyframe " + std::to_string(parent.value) +
                     " is in the subtree of keyframe " + std::to_string(child.value) +
                     " and cannot become its parent");
  }
  link(moved, parent);
}

void Map::choose_parent(KeyFrame& chooser) {
  // A keyframe that had no neighbours so far may already have children; taking one of its own
  // descendants as parent would cut both off from the root.
  for (const KeyFrameId neighbour : chooser.neighbours) {
    if (is_in_subtree(neighbour, chooser.id)) continue;
    link(chooser, neighbour);
    return;
  }
}

void Map::add_loop_edge(KeyFrameId a, KeyFrameId b) {
  if (a == b) throw StateError("a loop edge needs two different keyframes");
  KeyFrame& first = keyframe(a);
  KeyFrame& second = keyframe(b);
  first.loop_edges.insert(b);
  second.loop_edges.insert(a);
  keyframes_.touch(a);
  keyframes_.touch(b);
  ++structure_version_;
}

void Map::adopt_children(KeyFrame& dying, KeyFrameId grandparent) {
  std::vector<KeyFrameId> candidates{grandparent};
  const auto is_candidate = [&](KeyFrameId id) {
    return std::find(candidates.begin(), candidates.end(), id) != candidates.end();
  };
  while (!dying.children.empty()) {
    int best_weight = -1;
    KeyFrameId best_child, best_parent;
    for (const KeyFrameId child_id : dying.children) {
      const KeyFrame& child = keyframe(child_id);
      const auto parent =
          std::find_if(child.neighbours.begin(), child.neighbours.end(), is_candidate);
      if (parent == child.neighbours.end()) continue;
      const int shared = child.weights.at(*parent);
      if (shared <= best_weight) continue;
      best_weight = shared;
      best_child = child_id;
      best_parent = *parent;
    }
    if (!best_child.valid()) break;
    link(keyframe(best_child), best_parent);
    candidates.push_back(best_child);
  }
  while (!dying.children.empty()) link(keyframe(*dying.children.begin()), grandparent);
}

bool Map::erase_keyframe(KeyFrameId id) {
  KeyFrame* dying = keyframes_.find(id);
  if (!dying || is_root(*dying)) return false;
  if (dying->leases > 0 || !dying->loop_edges.empty()) {
    dying->to_be_erased = true;
    return false;
  }
  forget_covisibility(*dying);
  // Only observed slots: an unpublished keyframe also holds matches without an observation.
  for (std::size_t i = 0; i < dying->map_points.size(); ++i) {
    erase_observation(dying->map_points[i], id);
  }
  // The root stands in for the parent of a keyframe that dies before it was processed.
  const KeyFrameId grandparent = dying->parent.valid() ? dying->parent : root(dying->map);
  KeyFrame& parent = keyframe(grandparent);
  adopt_children(*dying, grandparent);
  parent.children.erase(id);
  archive_.emplace(id, ArchivedKeyFrame{grandparent, dying->T_cw * parent.T_cw.inverse(),
                                        dying->scale, parent.scale});
  if (dying->published) {
    --n_published_;
    --parts_.at(dying->map).n_published;
  }
  keyframes_.erase(id);
  ++structure_version_;
  return true;
}

}  // namespace orbslam
