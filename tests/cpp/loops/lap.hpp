// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "loops/loop.hpp"
#include "map/map.hpp"
#include "map/map_builder.hpp"

/// Keyframes along a way, each covisible with the one before, for tests of drift.
namespace orbslam::testing {

inline Pose standing_at(const Eigen::Vector3d& center, double heading) {
  const Eigen::Quaterniond R_wc(Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitY()));
  return Pose(R_wc, center).inverse();
}

struct Lap {
  static constexpr double kDepth = 3;  ///< of all points in the keyframe that made them [m]
  static constexpr int kShared = 20;   ///< points that successive keyframes share

  /// The next keyframe of the way.
  KeyFrameId add(const Eigen::Vector3d& center, double heading) {
    const auto k = static_cast<FrameId>(poses.size());
    poses.push_back(standing_at(center, heading));
    const KeyFrameId id = map.add_keyframe(make_raster_frame(k, 3 * kShared, kDepth), poses.back());
    map.publish(id);
    if (k > 0) share(KeyFrameId(k - 1), kShared, id, 0);
    return id;
  }
  /// `n` steps of `step` metres and `turn` radians each.
  void walk(int n, double step, double turn = 0) {
    for (int i = 0; i < n; ++i) {
      heading_ += turn;
      center_ += step * Eigen::Vector3d(std::sin(heading_), 0, std::cos(heading_));
      add(center_, heading_);
    }
  }
  /// New points kDepth ahead of `b` that both observe, from these slots on.
  void share(KeyFrameId a, std::size_t slot_a, KeyFrameId b, std::size_t slot_b) {
    for (std::size_t i = 0; i < kShared; ++i) {
      const MapPointId id =
          map.add_point(map.find(b)->T_cw.inverse() * Eigen::Vector3d(0, 0, kDepth), b, 0);
      map.add_observation(id, a, slot_a + i);
      map.add_observation(id, b, slot_b + i);
    }
    map.update_connections(a);
    map.update_connections(b);
  }

  KeyFrameId last() const { return KeyFrameId(static_cast<std::int64_t>(poses.size()) - 1); }

  /// Says that `current` is elsewhere: moved in the world, turned about its own axis.
  Loop loop(KeyFrameId current, KeyFrameId matched, const Eigen::Vector3d& moved, double turned = 0,
            double scale = 1, int n_matches = 50) const {
    const Pose T_cw = map.T_cw(current);
    const Eigen::Quaterniond R_wc =
        T_cw.rotation().conjugate() * Eigen::AngleAxisd(turned, Eigen::Vector3d::UnitY());
    const Pose corrected = Pose(R_wc, T_cw.center() + moved).inverse();
    Loop made;
    made.current = current;
    made.matched = matched;
    made.S_cw = Similarity(scale, corrected.rotation(), scale * corrected.translation());
    made.S_cm = made.S_cw * Similarity(map.T_cw(matched)).inverse();
    made.n_matches = n_matches;
    return made;
  }

  Map map;
  std::vector<Pose> poses;

 private:
  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();
  double heading_ = 0;
};

inline constexpr double kRightAngle = 1.5707963267948966;

/// A lap of 26 m around a block of 8 x 5 m in steps of 0.5 m, corners in three steps, and 2 m
/// more: keyframe 53 stands where keyframe 1 does.
inline void walk_lap(Lap& lap) {
  lap.add(Eigen::Vector3d::Zero(), 0);
  for (int side = 0; side < 5; ++side) {
    const int n = side == 4 ? 4 : (side % 2 == 0 ? 13 : 7);
    lap.walk(n, 0.5);
    if (side < 4) lap.walk(3, 0.5, kRightAngle / 3);
  }
}

}  // namespace orbslam::testing
