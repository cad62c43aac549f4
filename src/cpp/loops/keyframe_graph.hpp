// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "map/map.hpp"

namespace orbslam {

/// The shortest way between two keyframes along measured relative poses.
struct KeyFrameWay {
  double length = std::numeric_limits<double>::infinity();  ///< metres; infinite: there is none
  double turned = 0;                                        ///< radians
  double reach = 0;  ///< metres from its start to the keyframe on it that is farthest away

  bool exists() const { return length < std::numeric_limits<double>::infinity(); }
};

/// Graph of keyframes with measured relative poses, for searches without a lock. It is a copy of
/// poses, covisibility graph (KeyFrame::neighbours), spanning tree and loop edges of the map. See
/// docs/method/loops.md#choice.
class KeyFrameGraph {
 public:
  /// The caller holds a lock.
  explicit KeyFrameGraph(const Map& map);

  /// From `from` to each of `to`, in their order. The shortest way has the least sum of metres and
  /// `metres_per_radian` times radians (Dijkstra 1959; ties: by the keyframe with the lower id).
  /// A keyframe that was dead at the time of the copy has no paths.
  std::vector<KeyFrameWay> shortest_ways(KeyFrameId from, const std::vector<KeyFrameId>& to,
                                         double metres_per_radian) const;

 private:
  static constexpr std::int32_t kNone = -1;
  struct Reached;

  std::int32_t node_of(KeyFrameId id) const;
  std::vector<Reached> search(std::int32_t start, const std::vector<std::int32_t>& targets,
                              double metres_per_radian) const;
  KeyFrameWay way_to(std::int32_t node, const std::vector<Reached>& reached) const;

  // Nodes in the order of the keyframes' ids.
  std::vector<std::int32_t> nodes_;  // per id
  std::vector<Eigen::Vector3d> centers_;
  std::vector<Eigen::Quaterniond> rotations_;
  std::vector<std::size_t> ends_;  // per node: end of its linked ids
  std::vector<KeyFrameId> linked_;
};

}  // namespace orbslam
