// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "map/snapshot.hpp"

namespace orbslam {

/// Camera poses of all recorded frames, one entry each.
struct Trajectory {
  std::vector<double> timestamps;  ///< seconds
  std::vector<Matrix4> T_wc;       ///< camera to world; the world is the frame of the map's root
  std::vector<std::uint8_t> lost;  ///< 1: tracking was lost, the pose repeats the last known one
  std::vector<FrameId> frames;
};

/// Remembers each frame relative to its reference keyframe, so that all later optimisation moves
/// the frames with their keyframes. Not synchronised: one thread records and rebuilds. See
/// docs/method/map.md#anchors.
class TrajectoryRecorder {
 public:
  /// Appends a frame, or records one anew that is there already. Without a pose or a reference
  /// keyframe it repeats the relative pose before it. Before the first pose there is none, and the
  /// frame is always lost. Takes the map's read lock. Throws StateError when the map was cleared
  /// since the first record and clear() was not called.
  void record(const Map& map, const TrackedFrame& frame, bool lost);

  /// All poses in one map (kNoMap: the active one), through culled keyframes as well, anchored at
  /// its root. Takes the map's read lock. Frames without a keyframe, recorded before the first
  /// pose, have the identity and belong to the map of the next one that has (the active one, if
  /// there is none). Throws StateError as above.
  Trajectory rebuild(const Map& map, MapIndex which = kNoMap) const;

  /// Pose of a recorded frame in the present map; none for a lost or unknown frame. The caller
  /// holds a lock of the map.
  std::optional<Pose> T_cw(const Map& map, FrameId frame) const;

  /// The keyframe that the frame's pose is relative to; an invalid id for a lost or unknown frame.
  KeyFrameId reference(FrameId frame) const;

  /// Replaces the pose of a frame that has one; the pose is in the present map. The caller holds a
  /// lock of the map.
  void move(const Map& map, FrameId frame, const Pose& T_cw);

  /// Forgets the frames of one map, which is about to be dropped. Takes the map's read lock.
  void drop(const Map& map, MapIndex which);

  /// All recorded frames, relative to their keyframes, as in map files.
  struct Entries {
    std::vector<double> timestamps;  ///< seconds
    std::vector<FrameId> frames;
    std::vector<KeyFrameId> references;  ///< invalid before the first pose
    /// T_cr of camera and reference keyframe at the keyframe's first scale: x, y, z, w of the unit
    /// quaternion, then the translation.
    std::vector<std::array<double, 7>> T_cr;
    std::vector<std::uint8_t> lost;
  };
  Entries entries() const;

  void clear();
  std::size_t size() const { return timestamps_.size(); }
  /// Allocated memory; stays below 120 bytes a frame for long sequences.
  std::size_t n_bytes() const;

 private:
  struct RelativePose {  // T_cr at the keyframe's first scale, as plain numbers: Eigen's quaternion
                         // would pad to 64 bytes
    double qw = 1, qx = 0, qy = 0, qz = 0, x = 0, y = 0, z = 0;
  };
  static RelativePose relative_pose(const Pose& T_cr, double scale);
  static Pose pose_of(const RelativePose& r, double scale);
  void check_epoch(const Map& map) const;
  std::size_t place_of(FrameId frame) const;
  std::size_t place_with_pose(FrameId frame) const;
  void truncate(std::size_t n);
  std::vector<MapIndex> maps_of_frames(const Map& map) const;

  std::vector<double> timestamps_;
  std::vector<RelativePose> T_cr_;
  std::vector<KeyFrameId> references_;
  std::vector<FrameId> frames_;
  std::vector<std::uint8_t> lost_;
  std::uint64_t epoch_ = 0;  // of the map at the first record
};

}  // namespace orbslam
