// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

#include "loops/loop_correction.hpp"
#include "map/point_batch.hpp"
#include "matching/id_index.hpp"

namespace orbslam {

/// Keyframes with which a keyframe shares points, and how many; ascending ids.
using SharedPoints = std::vector<std::pair<KeyFrameId, int>>;

/// Neighbours by shared points: the up-to-date value of KeyFrame::neighbours.
std::vector<KeyFrameId> neighbours_by(const SharedPoints& shared);

/// Copies of the slots of a group of keyframes, of their points, and of the points on the far side
/// of a loop. Fusions are tried out on these copies; the map does not change. See
/// docs/method/loops.md#fusion-across-the-loop.
class FusionDraft {
 public:
  /// Copies living keyframes, and living points of `far`, each once. The caller holds a lock.
  FusionDraft(const Map& map, const std::vector<KeyFrameId>& group,
              const std::vector<MapPointId>& far);

  const Frame& frame(std::size_t k) const { return *keyframes_[k].frame; }
  const Pose& T_cw(std::size_t k) const { return keyframes_[k].T_cw; }
  /// The copied points of the far side.
  const PointBatch& far_points() const { return far_points_; }

  /// Keypoint `keypoint` of the k-th keyframe shows a point of the far side: the point is added to
  /// it or takes the place of the point that is there. Nothing happens when the keyframe observes
  /// the point already, and when both points are on the far side and some keyframe sees them as
  /// two.
  void fuse(std::size_t k, std::uint32_t keypoint, MapPointId far_point);
  std::vector<LoopCorrection::Fusion> take_fusions() { return std::move(fusions_); }

  /// Per keyframe of the group, with the fusions made so far.
  std::vector<SharedPoints> shared_points() const;

  /// The keyframe with which a point moves: the first of the group that observed it when it was
  /// copied; for points of the far side one outside of the group, if there is any. Invalid for
  /// points that were not copied.
  KeyFrameId carrier(MapPointId id) const;

 private:
  static constexpr std::int32_t kNone = PointIdIndex::kNone;

  struct GroupKeyFrame {
    KeyFrameId id;
    std::shared_ptr<const Frame> frame;
    Pose T_cw;
    std::vector<std::int32_t> slots;  // places in points_; those in use have not been replaced
  };
  struct Point {
    MapPointId id;
    bool far = false;
    std::int32_t successor = kNone;  // the point that took its place
    KeyFrameId carrier;
    std::vector<Observation> observations;  // ascending keyframes
  };

  std::int32_t copy(const MapPoint& point, bool far, KeyFrameId carrier);
  KeyFrameId carrier_outside(const MapPoint& point) const;
  std::int32_t resolve(MapPointId id) const;
  void observe(Point& point, KeyFrameId keyframe, std::uint32_t keypoint);
  void set_slot(KeyFrameId keyframe, std::uint32_t keypoint, std::int32_t point);
  void replace(std::int32_t place, std::int32_t by);

  std::vector<GroupKeyFrame> keyframes_;
  std::unordered_map<KeyFrameId, std::size_t> position_of_;  // in the group; for look-ups only
  std::vector<Point> points_;
  PointIdIndex place_of_;
  PointBatch far_points_;
  std::vector<LoopCorrection::Fusion> fusions_;
};

/// Carries out the drafted fusions [first, last); keyframes and points that have died since are
/// skipped. Returns the number of changes. Points that gained an observation are appended to
/// `added`. The caller holds the write lock.
int carry_out(const std::vector<LoopCorrection::Fusion>& fusions, std::size_t first,
              std::size_t last, Map& map, std::vector<MapPointId>& added);

}  // namespace orbslam
