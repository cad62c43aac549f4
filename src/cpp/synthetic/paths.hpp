// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "base/pose.hpp"

namespace orbslam::synthetic {

/// How a camera departs from its path.
struct PathOptions {
  double lateral = 0;   ///< metres to the right of the path: other viewpoints of the same places
  double yaw = 0;       ///< radians to the right of the direction of travel
  double sway = 0.08;   ///< metres; amplitude of the carrier's gait to the side, half of it up
  double stride = 1.7;  ///< metres; way between two sways to the same side
};

/// A way along corridors or streets: straight legs joined by arcs, in the plane y = 0 of the world
/// frame (x right, y down, z forward). The look direction follows the way, smoothed so that the
/// turn rate is continuous; position and orientation are functions of the arc length only.
class Way {
 public:
  /// Through the `corners` (x, z) [m], rounded with arcs of `radius`; a closed way starts in the
  /// middle between the last corner and the first. Throws SettingsError if a leg is too short for
  /// its arcs.
  Way(const std::vector<Eigen::Vector2d>& corners, double radius, bool closed);

  /// Metres. A closed way may be followed further: it goes round again.
  double length() const { return length_; }

  /// Pose (camera to world) after `distance` metres. Open ways end in straight lines.
  Pose T_wc(double distance, const PathOptions& options = {}) const;

 private:
  struct Piece {
    double begin, length;       // arc length
    Eigen::Vector2d start;      // (x, z)
    double heading, curvature;  // at its start [rad, from z towards x]; [rad/m]
    double heading_integral;    // of all pieces before
  };

  void add_piece(double length, double curvature);
  const Piece& piece_at(double distance) const;
  double wrapped(double distance, double& laps) const;
  Eigen::Vector2d position(double distance) const;
  double heading_integral(double distance) const;

  std::vector<Piece> pieces_;
  double length_ = 0;
  double smoothing_ = 0;  // metres before and after over which the heading is averaged
  bool closed_;
};

/// A person looking around in a room of the given size [m] centred on the origin: the camera
/// sways on a Lissajous figure in the middle of the room, and turns around once in `period`
/// seconds (at most 0.8 m/s and 30 degrees/s for rooms up to 10 m and periods from 24 s on).
Pose room_T_wc(const Eigen::Vector3d& size, double seconds, double period = 30);

/// The ways through the worlds of world.hpp with the same sizes.
Way corridor_way(double length, double breadth, double width);
/// Twice along the middle leg per round, first past the left, then past the right block.
Way figure_eight_way(double length, double breadth, double width);
Way street_way(double length);
/// Once around the block, always to the right, in bends of radius `width`.
Way street_lap_way(double length, double breadth, double width);
/// From the first room through the door into the second.
Way two_rooms_way(const Eigen::Vector3d& size, double passage);

}  // namespace orbslam::synthetic
