// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "loops/loop_correction.hpp"
#include "map/map_rewrite.hpp"

namespace orbslam {

/// The two halves of apply_loop_correction(): the preparation under a read lock, and the write
/// section. Refers to the correction, which must outlive it. See docs/method/loops.md#correction.
class PreparedCorrection {
 public:
  /// Takes the read lock, for a short while at a time.
  PreparedCorrection(const Map& map, const LoopCorrection& correction);
  /// The caller holds the write lock. Keyframes may have been added since the preparation, with
  /// points of their own: they follow too.
  LoopCorrectionResult commit(Map& map) const;

 private:
  const Similarity& world_at(KeyFrameId id) const;
  void move_keyframe(const KeyFrame& keyframe, MapRewrite& rewrite) const;
  static void move_point(const MapPoint& point, const Similarity& world, MapRewrite& rewrite);
  MapRewrite newcomers(const Map& map) const;

  const LoopCorrection& correction_;
  std::vector<Similarity> world_;  // per vertex: from the old world to the new; empty: not to apply
  MapRewrite rewrite_;
  KeyFrameId last_;  // that was prepared
};

}  // namespace orbslam
