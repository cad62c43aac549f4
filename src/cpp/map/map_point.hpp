// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <memory>
#include <vector>

#include "base/descriptor.hpp"
#include "base/ids.hpp"
#include "map/point_patch.hpp"

namespace orbslam {

struct Observation {
  KeyFrameId keyframe;
  std::uint32_t index = 0;  ///< keypoint of that keyframe
  bool has_depth = false;   ///< a stereo observation counts 2, a monocular one 1
};

/// The order of a point's observations, for binary searches.
inline bool precedes(const Observation& observation, KeyFrameId keyframe) {
  return observation.keyframe < keyframe;
}

/// Position of a point, and the direction and scale range that follow from it and the poses of its
/// observers.
struct PointGeometry {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_direction = Eigen::Vector3d::Zero();
  double min_distance = 0, max_distance = 0;
};

/// A counter that may grow while other threads read the map. Tracking adds to it at every image,
/// and must not wait for threads that copy the map. See docs/method/threads.md#locks.
class SightingCount {
 public:
  explicit SightingCount(int n) : n_(n) {}
  SightingCount(const SightingCount& other) : n_(other.value()) {}
  SightingCount& operator=(const SightingCount& other) {
    n_.store(other.value(), std::memory_order_relaxed);
    return *this;
  }
  ~SightingCount() = default;

  int value() const { return n_.load(std::memory_order_relaxed); }
  /// The read lock of the map is enough.
  void add(int n) const { n_.fetch_add(n, std::memory_order_relaxed); }

 private:
  mutable std::atomic<int> n_;
};

/// A 3-D point of the map. Only the Map changes it, so that both sides of an observation, the
/// count and the derived fields always agree. See docs/method/map.md#map-points.
struct MapPoint {
  MapPointId id;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< world
  /// Mean of the unit vectors from the observing cameras to the point; its length is <= 1.
  Eigen::Vector3d mean_direction = Eigen::Vector3d::Zero();
  double min_distance = 0;  ///< raw scale range [world units]; gates use 0.8 and 1.2 times
  double max_distance = 0;
  Descriptor descriptor;
  std::shared_ptr<const PointPatch> patch;  ///< null: no reference sighting

  std::vector<Observation> observations;  ///< ascending keyframe id, one per keyframe
  int observation_count = 0;              ///< weighted: 2 per observation with depth, else 1
  SightingCount n_visible{1};             ///< frames in whose view the point lay
  SightingCount n_found{1};               ///< of these, frames that matched it as an inlier

  KeyFrameId reference_keyframe;  ///< gives the scale range; always among the observations
  KeyFrameId first_keyframe;      ///< the creating keyframe
  FrameId first_frame = -1;

  double found_ratio() const { return static_cast<double>(n_found.value()) / n_visible.value(); }
  const Observation* observation_of(KeyFrameId keyframe) const;
};

}  // namespace orbslam
