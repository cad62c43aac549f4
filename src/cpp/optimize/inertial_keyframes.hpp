// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "inertial/preintegration.hpp"
#include "map/map.hpp"

namespace orbslam {

struct GatheredBundle;

/// Samples of an IMU, and its velocities and biases at keyframes. They are stored outside the map.
/// Velocities are in the axes of the keyframe and in units of the map, so code that moves keyframes
/// need not change them. The object has its own lock, which is taken after that of the map.
class InertialKeyframes {
 public:
  InertialKeyframes(const Pose& T_cb, const ImuNoise& noise) : T_cb_(T_cb), noise_(noise) {}

  /// Samples after those before, which they may overlap by one.
  void add_samples(const std::vector<ImuSample>& samples);
  /// Velocity of the IMU [m/s] in the axes of a keyframe's camera, which has this KeyFrame::scale.
  void set(KeyFrameId keyframe, const Eigen::Vector3d& velocity, const ImuBias& bias,
           double scale = 1);
  void clear();
  std::size_t size() const;
  /// False where there is none.
  bool find(KeyFrameId keyframe, Eigen::Vector3d& velocity, ImuBias& bias) const;

  /// Newest keyframes with a state of a map, up to `n`, by time. The caller holds a lock of the
  /// map.
  std::vector<KeyFrameId> newest(const Map& map, MapIndex which, std::size_t n) const;
  /// Without this keyframe its neighbours in time would be too far apart: more than half a second,
  /// or 3 s where the newest keyframe is 15 s later. The caller holds a lock of the map.
  bool is_needed(const Map& map, KeyFrameId keyframe) const;
  /// Adds motions of the cameras of a bundle that are in `chain`, and links between neighbours.
  /// The caller holds a lock of the map.
  void add_to(GatheredBundle& bundle, const std::vector<KeyFrameId>& chain, const Map& map) const;
  /// Takes the motions of a solved bundle.
  void take_from(const GatheredBundle& bundle, const Map& map);

 private:
  struct State {
    Eigen::Vector3d velocity;
    ImuBias bias;
    double scale = 1;
  };
  const State* state_of(KeyFrameId keyframe) const;
  std::shared_ptr<const Preintegration> between(double begin, double end,
                                                const ImuBias& bias) const;

  Pose T_cb_;
  ImuNoise noise_;
  mutable std::mutex mutex_;
  std::vector<ImuSample> samples_;
  std::map<KeyFrameId, State> states_;
};

}  // namespace orbslam
