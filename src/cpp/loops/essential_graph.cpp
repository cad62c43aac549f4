// SPDX-License-Identifier: BSD-3-Clause
#include "loops/essential_graph.hpp"

#include <algorithm>
#include <unordered_map>
#include <unordered_set>

namespace orbslam {
namespace {

/// Data of the map that the graph needs.
struct GraphSource {
  std::vector<Pose> T_cw;  // per vertex
  using Pairs = std::vector<std::pair<KeyFrameId, KeyFrameId>>;
  Pairs parents;    // child, parent
  Pairs loops;      // later, earlier
  Pairs covisible;  // later, earlier; without those of the group
};

using Members = std::unordered_map<KeyFrameId, std::size_t>;

GraphSource copy_source(const Map& map, LoopCorrection& correction, const Members& members,
                        std::vector<KeyFrameId>& keyframes) {
  GraphSource source;
  const auto lock = map.read_lock();
  const MapIndex which = map.map_of(correction.loop.current);
  correction.map = which;
  map.for_each_keyframe([&](const KeyFrame& keyframe) {
    if (!keyframe.published || keyframe.map != which) return;
    const KeyFrameId id = keyframe.id;
    keyframes.push_back(id);
    source.T_cw.push_back(keyframe.T_cw);
    if (keyframe.parent.valid()) source.parents.emplace_back(id, keyframe.parent);
    for (const KeyFrameId other : keyframe.loop_edges) {
      if (other < id) source.loops.emplace_back(id, other);
    }
    if (members.count(id) > 0) return;  // their weights come with the fusions
    for (const auto& [other, weight] : keyframe.weights) {
      if (!(other < id)) break;
      if (weight >= Map::kEssentialWeight && members.count(other) == 0) {
        source.covisible.emplace_back(id, other);
      }
    }
  });
  return source;
}

void add_covisible_of_group(const CorrectedGroup& group, const Members& members,
                            GraphSource::Pairs& covisible) {
  for (std::size_t k = 0; k < group.keyframes.size(); ++k) {
    const KeyFrameId id = group.keyframes[k];
    for (const auto& [other, weight] : group.shared[k]) {
      if (weight < Map::kEssentialWeight) continue;
      if (other > id && members.count(other) > 0) continue;  // the other end adds it
      covisible.emplace_back(std::max(id, other), std::min(id, other));
    }
  }
}

class EdgeWriter {
 public:
  EdgeWriter(const std::vector<KeyFrameId>& keyframes, PoseGraph& graph)
      : keyframes_(keyframes), graph_(graph) {}

  /// Adds an edge whose measurement is the relative pose in `poses` (poses of the vertices). Adds
  /// nothing if the pair already has an edge, or if one of them is no vertex.
  void add(KeyFrameId a, KeyFrameId b, const std::vector<Similarity>& poses) {
    const std::ptrdiff_t at_a = vertex_of(keyframes_, a), at_b = vertex_of(keyframes_, b);
    if (at_a < 0 || at_b < 0 || a == b) return;
    const auto i = static_cast<std::uint32_t>(at_a), j = static_cast<std::uint32_t>(at_b);
    const std::uint64_t pair = (std::uint64_t{std::min(i, j)} << 32) | std::max(i, j);
    if (!pairs_.insert(pair).second) return;
    graph_.edges.push_back({i, j, poses[j] * poses[i].inverse()});
  }

 private:
  const std::vector<KeyFrameId>& keyframes_;
  PoseGraph& graph_;
  std::unordered_set<std::uint64_t> pairs_;
};

int shared_with(const SharedPoints& shared, KeyFrameId id) {
  const auto at =
      std::lower_bound(shared.begin(), shared.end(), id,
                       [](const auto& entry, KeyFrameId other) { return entry.first < other; });
  return at != shared.end() && at->first == id ? at->second : 0;
}

}  // namespace

std::ptrdiff_t vertex_of(const std::vector<KeyFrameId>& keyframes, KeyFrameId id) {
  const auto at = std::lower_bound(keyframes.begin(), keyframes.end(), id);
  return at != keyframes.end() && *at == id ? at - keyframes.begin() : -1;
}

std::size_t vertex_before(const std::vector<KeyFrameId>& keyframes, KeyFrameId id) {
  const auto after = std::upper_bound(keyframes.begin(), keyframes.end(), id);
  return after == keyframes.begin() ? 0 : static_cast<std::size_t>(after - keyframes.begin()) - 1;
}

void build_essential_graph(const Map& map, const CorrectedGroup& group,
                           LoopCorrection& correction) {
  Members members;
  for (const KeyFrameId id : group.keyframes) members.emplace(id, members.size());
  std::vector<KeyFrameId> keyframes;
  GraphSource source = copy_source(map, correction, members, keyframes);
  const std::ptrdiff_t matched = vertex_of(keyframes, correction.loop.matched);
  if (matched < 0 || vertex_of(keyframes, correction.loop.current) < 0) return;
  add_covisible_of_group(group, members, source.covisible);

  std::vector<Similarity> uncorrected;
  for (const Pose& T_cw : source.T_cw) uncorrected.emplace_back(T_cw);
  std::vector<Similarity> start = uncorrected;
  for (std::size_t k = 0; k < group.keyframes.size(); ++k) {
    const std::ptrdiff_t vertex = vertex_of(keyframes, group.keyframes[k]);
    if (vertex >= 0) start[static_cast<std::size_t>(vertex)] = group.corrected[k];
  }

  PoseGraph graph;
  EdgeWriter edges(keyframes, graph);
  edges.add(correction.loop.current, correction.loop.matched, start);
  for (const auto& [member, other] : group.links) {
    const int weight = shared_with(group.shared[members.at(member)], other);
    if (weight >= Map::kEssentialWeight) edges.add(member, other, start);
  }
  for (const auto& [child, parent] : source.parents) edges.add(child, parent, uncorrected);
  for (const auto& [later, earlier] : source.loops) edges.add(later, earlier, uncorrected);
  for (const auto& [later, earlier] : source.covisible) edges.add(later, earlier, uncorrected);

  graph.fixed.assign(keyframes.size(), 0);
  graph.fixed[static_cast<std::size_t>(matched)] = 1;
  graph.S_iw = std::move(start);
  correction.graph = std::move(graph);
  correction.keyframes = std::move(keyframes);
  correction.uncorrected = std::move(uncorrected);
}

}  // namespace orbslam
