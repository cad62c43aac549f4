// SPDX-License-Identifier: BSD-3-Clause
#include "loops/keyframe_graph.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <queue>
#include <utility>

namespace orbslam {
namespace {

/// Between two orientations [rad], in [0, pi].
double angle_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  const Eigen::Quaterniond turn = a * b.conjugate();
  return 2 * std::atan2(turn.vec().norm(), std::abs(turn.w()));
}

}  // namespace

/// State of a node during a search.
struct KeyFrameGraph::Reached {
  double cost = std::numeric_limits<double>::infinity();
  double length = 0, turned = 0;
  std::int32_t previous = kNone;
  bool settled = false;
};

KeyFrameGraph::KeyFrameGraph(const Map& map) {
  map.for_each_keyframe([&](const KeyFrame& keyframe) {
    nodes_.resize(static_cast<std::size_t>(keyframe.id.value), kNone);
    nodes_.push_back(static_cast<std::int32_t>(centers_.size()));
    centers_.push_back(keyframe.center());
    rotations_.push_back(keyframe.T_cw.rotation());
    linked_.insert(linked_.end(), keyframe.neighbours.begin(), keyframe.neighbours.end());
    if (keyframe.parent.valid()) linked_.push_back(keyframe.parent);
    linked_.insert(linked_.end(), keyframe.children.begin(), keyframe.children.end());
    linked_.insert(linked_.end(), keyframe.loop_edges.begin(), keyframe.loop_edges.end());
    ends_.push_back(linked_.size());
  });
}

std::int32_t KeyFrameGraph::node_of(KeyFrameId id) const {
  const auto index = static_cast<std::size_t>(id.value);
  return id.valid() && index < nodes_.size() ? nodes_[index] : kNone;
}

std::vector<KeyFrameGraph::Reached> KeyFrameGraph::search(std::int32_t start,
                                                          const std::vector<std::int32_t>& targets,
                                                          double metres_per_radian) const {
  std::vector<Reached> reached(centers_.size());
  std::vector<std::uint8_t> is_target(centers_.size(), 0);
  std::size_t n_targets = 0;
  for (const std::int32_t target : targets) {
    if (target == kNone || is_target[static_cast<std::size_t>(target)]) continue;
    is_target[static_cast<std::size_t>(target)] = 1;
    ++n_targets;
  }
  using Entry = std::pair<double, std::int32_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  reached[static_cast<std::size_t>(start)].cost = 0;
  queue.emplace(0.0, start);
  while (n_targets > 0 && !queue.empty()) {
    const auto node = static_cast<std::size_t>(queue.top().second);
    queue.pop();
    if (reached[node].settled) continue;
    reached[node].settled = true;
    if (is_target[node] && --n_targets == 0) break;
    for (std::size_t k = node == 0 ? 0 : ends_[node - 1]; k < ends_[node]; ++k) {
      const std::int32_t linked = node_of(linked_[k]);
      if (linked == kNone) continue;
      const auto next = static_cast<std::size_t>(linked);
      if (reached[next].settled) continue;
      const double length = (centers_[next] - centers_[node]).norm();
      if (!(reached[node].cost + length < reached[next].cost)) continue;  // spares the angle
      const double turned = angle_between(rotations_[next], rotations_[node]);
      const double cost = reached[node].cost + length + metres_per_radian * turned;
      if (!(cost < reached[next].cost)) continue;
      reached[next] = {cost, reached[node].length + length, reached[node].turned + turned,
                       static_cast<std::int32_t>(node), false};
      queue.emplace(cost, linked);
    }
  }
  return reached;
}

KeyFrameWay KeyFrameGraph::way_to(std::int32_t node, const std::vector<Reached>& reached) const {
  if (node == kNone || !reached[static_cast<std::size_t>(node)].settled) return {};
  const Reached& end = reached[static_cast<std::size_t>(node)];
  KeyFrameWay way{end.length, end.turned, 0};
  std::vector<std::size_t> stops;
  for (std::int32_t k = node; k != kNone; k = reached[static_cast<std::size_t>(k)].previous) {
    stops.push_back(static_cast<std::size_t>(k));
  }
  for (const std::size_t stop : stops) {
    way.reach = std::max(way.reach, (centers_[stop] - centers_[stops.back()]).norm());
  }
  return way;
}

std::vector<KeyFrameWay> KeyFrameGraph::shortest_ways(KeyFrameId from,
                                                      const std::vector<KeyFrameId>& to,
                                                      double metres_per_radian) const {
  std::vector<KeyFrameWay> ways(to.size());
  const std::int32_t start = node_of(from);
  if (start == kNone) return ways;
  std::vector<std::int32_t> targets(to.size());
  std::transform(to.begin(), to.end(), targets.begin(),
                 [this](KeyFrameId id) { return node_of(id); });
  const std::vector<Reached> reached = search(start, targets, metres_per_radian);
  std::transform(targets.begin(), targets.end(), ways.begin(),
                 [&](std::int32_t target) { return way_to(target, reached); });
  return ways;
}

}  // namespace orbslam
