// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "loops/loop_verification.hpp"
#include "matching/scenes.hpp"

/// A place that was mapped twice, for the tests of loops.
namespace orbslam::testing {

/// Rotation [rad] about an axis that is none of the coordinates', translation [m], scale.
inline Similarity drift_by(double rotation, double translation, double scale = 1) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1, 5, -2).normalized();
  return Similarity(scale, Eigen::Quaterniond(Eigen::AngleAxisd(rotation, axis)),
                    translation * Eigen::Vector3d(2, -1, 2) / 3);
}

/// Keyframes 0 to 2 saw the points of the cloud, and keyframes 3 and 4 saw them again, without
/// knowing it, in a part of the map that has drifted: what was at p is at `drift * p` there.
struct TwiceMappedScene : Scene {
  static constexpr KeyFrameId kMatched{1}, kCurrent{4};

  explicit TwiceMappedScene(const Similarity& drift_in, std::size_t n_points = 400,
                            const ProjectionOptions& options = {}, std::uint64_t seed = 3)
      : Scene(n_points, seed), drift(drift_in) {
    std::mt19937_64 random(seed + 1);
    ProjectionOptions own = options;
    for (int k = 0; k < 3; ++k) {
      own.seed = random();
      observe_all(add_keyframe(small_motion(random, 0.03, 0.15), own));
    }
    first_lap = points;
    forget(0, points.size());
    for (int k = 3; k < 5; ++k) {
      own.seed = random();
      add_drifted(small_motion(random, 0.03, 0.15), own);
    }
    for (const MapPointId id : points) {
      if (id.valid()) map.update_point(id);
    }
    for (const KeyFrameId id : map.keyframe_ids()) map.update_connections(id);
  }

  /// World, as keyframes 0 to 2 know it, to `current`.
  Similarity true_S_cw() const { return Similarity(map.find(kCurrent)->T_cw) * drift; }
  Similarity true_S_cm() const {
    return true_S_cw() * Similarity(map.find(kMatched)->T_cw).inverse();
  }
  /// The point of the first lap that a keypoint of `current` shows; invalid: not mapped then.
  MapPointId partner(std::size_t keypoint) const {
    return first_lap[projected[static_cast<std::size_t>(kCurrent.value)].points[keypoint]];
  }
  /// Point i of the cloud as `current` knows it is somewhere else in the map.
  void displace(std::size_t i, const Similarity& by) {
    if (points[i].valid()) map.set_position(points[i], drift * (by * cloud.positions[i]));
  }

  Similarity drift;
  std::vector<MapPointId> first_lap;  ///< per point of the cloud

 private:
  void add_drifted(const Pose& T_cw, const ProjectionOptions& options) {
    // The image depends on the true pose; the keyframe is where the drifted map puts it.
    const KeyFrameId id = add_keyframe(T_cw, options);
    const Similarity S_cw = Similarity(T_cw) * drift.inverse();
    map.set_pose(id, S_cw.pose());
    const auto& seen = projected.back().points;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      MapPointId& point = points[seen[i]];
      if (!point.valid()) point = map.add_point(drift * cloud.positions[seen[i]], id, 0);
      map.add_observation(point, id, i);
    }
  }
};

/// The largest difference of two similarities' matrices.
inline double difference(const Similarity& a, const Similarity& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff();
}

}  // namespace orbslam::testing
