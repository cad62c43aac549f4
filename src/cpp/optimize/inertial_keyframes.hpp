// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "inertial/preintegration.hpp"
#include "map/map.hpp"

namespace orbslam {

struct GatheredBundle;

/// Velocities and biases at keyframes with what was measured between them, as map files keep them.
/// See docs/reference/map_file.md.
struct InertialRows {
  std::vector<KeyFrameId> ids;  ///< ascending
  /// Of the IMU in the axes of the keyframe's camera, as long as it has this KeyFrame::scale.
  std::vector<Eigen::Vector3d> velocity;
  std::vector<double> scale;
  std::vector<ImuBias> bias;
  /// Samples from the row before to this one are [offsets[i], offsets[i + 1]). They cover the time
  /// from one keyframe to the other. Where samples have a gap there are none.
  std::vector<std::size_t> offsets{0};
  std::vector<ImuSample> samples;
  /// Per row the keyframe, the keyframe of the row before (-1 for none), and the number of the last
  /// change of the state: equal ones are of equal rows.
  std::vector<std::array<std::int64_t, 3>> versions;
  std::vector<std::uint8_t> changed;  ///< one a row: its version is not known; else no samples
};

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
  /// That of the keyframe with the highest id; false where there is none.
  bool newest_bias(ImuBias& bias) const;

  /// Copies the states of these keyframes (ascending ids, with their time stamps [s]) and the
  /// samples between them. Rows with a version in `known` (ascending) come without samples.
  InertialRows take(const std::vector<KeyFrameId>& keyframes, const std::vector<double>& times,
                    const std::vector<std::array<std::int64_t, 3>>& known = {}) const;
  /// Replaces everything by the states of an earlier run. Samples that come later join none of
  /// them, because times may begin anew.
  void put(const InertialRows& rows);

  /// Newest keyframes with a state of a map, up to `n`, by time; none of an earlier run. The caller
  /// holds a lock of the map.
  std::vector<KeyFrameId> newest(const Map& map, MapIndex which, std::size_t n) const;
  /// Without this keyframe its neighbours in time would be too far apart: more than half a second,
  /// or 3 s where the newest keyframe is 15 s later, or of an earlier run. The caller holds a lock
  /// of the map.
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
    std::size_t stretch = 0;  ///< of samples_
    std::int64_t last_change = 0;
  };
  using Samples = std::vector<ImuSample>;

  const State* state_of(KeyFrameId keyframe) const;
  void set_state(KeyFrameId keyframe, const Eigen::Vector3d& velocity, const ImuBias& bias,
                 double scale);
  bool is_of_earlier_run(const State& state) const { return state.stretch + 1 < samples_.size(); }
  std::shared_ptr<const Preintegration> between(std::size_t stretch, double begin, double end,
                                                const ImuBias& bias) const;

  Pose T_cb_;
  ImuNoise noise_;
  mutable std::mutex mutex_;
  /// Stretches without a common time: those of earlier runs, and at the end that of this run.
  std::vector<Samples> samples_{1};
  std::map<KeyFrameId, State> states_;
  std::int64_t n_changes_ = 0;
};

}  // namespace orbslam
