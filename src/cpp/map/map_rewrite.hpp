// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <unordered_map>
#include <vector>

#include "map/map.hpp"

namespace orbslam {

/// New poses and positions for many keyframes and points. Viewing directions and scale ranges of
/// the points are computed before the write section, which therefore only copies. See
/// docs/method/loops.md#correction and docs/method/adjustment.md#full-bundle-adjustment.
class MapRewrite {
 public:
  /// `rescaled`: the factor of lengths around the keyframe.
  void move_keyframe(KeyFrameId id, const Pose& T_cw, double rescaled = 1);
  void move_point(MapPointId id, const Eigen::Vector3d& position);

  /// Computes the points' geometry from the new poses, or from the old pose of a keyframe without a
  /// new one. Takes the read lock many times for a short while, because tracking writes to the map
  /// at every frame and would have to wait for a large map.
  void prepare(const Map& map);
  /// The same in one go. The caller holds a lock.
  void prepare_locked(const Map& map);
  /// Writes the objects that still live. Points whose observations have changed since prepare(), or
  /// that were not prepared, are computed now. The caller holds the write lock.
  void apply(Map& map) const;

  std::size_t n_keyframes() const { return keyframes_.size(); }
  std::size_t n_points() const { return points_.size(); }
  /// The new pose; nullptr without one.
  const Pose* T_cw(KeyFrameId id) const;

 private:
  struct MovedKeyFrame {
    KeyFrameId id;
    Pose T_cw;
    double rescaled = 1;
  };
  struct MovedPoint {
    MapPointId id;
    PointGeometry geometry;
    std::size_t n_observations = 0;  // when it was prepared; 0: it was not
  };
  using Centers = std::unordered_map<KeyFrameId, Eigen::Vector3d>;

  Centers centers_of(const Map& map);
  void prepare_point(const Map& map, const Centers& center_of, MovedPoint& moved);

  std::vector<MovedKeyFrame> keyframes_;
  std::vector<MovedPoint> points_;
  std::unordered_map<KeyFrameId, std::size_t> slot_of_;  // for look-ups only
  std::vector<Eigen::Vector3d> centers_;                 // of one point at a time
  bool rigs_ = false;  // a keyframe has several cameras, each with a centre of its own
};

}  // namespace orbslam
