// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "map/map.hpp"

namespace orbslam {

/// A loop is accepted only if consecutive keyframes propose the same part of the map (Mur-Artal et
/// al. 2015, section VII-A). The object remembers the proposals of the keyframe before. For one
/// thread. See docs/method/loops.md#consistency.
class LoopConsistency {
 public:
  static constexpr int kNeeded = 3;  ///< consecutive confirmations

  /// The candidates of the next keyframe, ascending ids; none breaks all chains. Returns those
  /// whose part of the map (they and their covisible keyframes) has been proposed by kNeeded
  /// keyframes before this one, in the given order. Parts proposed by successive keyframes are
  /// the same when they share a keyframe; the first candidate to meet a part of the keyframe
  /// before carries its chain on. Dead candidates are ignored. Takes the map's read lock while it
  /// copies.
  std::vector<KeyFrameId> update(const Map& map, const std::vector<KeyFrameId>& candidates);

  /// After a correction, a gap or a reset.
  void clear() { groups_.clear(); }

 private:
  struct Group {
    std::vector<KeyFrameId> members;  // ascending
    int confirmations = 0;            // by keyframes after the one that proposed it first
  };
  std::vector<Group> groups_;
};

}  // namespace orbslam
