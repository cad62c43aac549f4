// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "driver/worker.hpp"
#include "loops/loop_detection.hpp"
#include "loops/loop_verification.hpp"
#include "map/map.hpp"
#include "optimize/inertial_keyframes.hpp"
#include "places/keyframe_index.hpp"

namespace orbslam::driver {

/// What happened so far, over all maps and systems.
struct Counts {
  std::atomic<int> frames{0}, lost{0}, relocalized{0}, keyframes{0}, resets{0}, mode_switches{0};
  std::atomic<int> localized{0};  ///< frames tracked in localization mode
  std::atomic<int> verified{0}, loops_closed{0}, corrections_dropped{0};
  std::atomic<int> adjustments_begun{0}, adjustments_committed{0}, adjustments_dropped{0};
  std::atomic<int> pauses{0}, snapshots{0}, shutdowns{0};
  /// Beside others; found again in one that had rested; given up when small; made one of two.
  std::atomic<int> maps_begun{0}, maps_switched{0}, maps_dropped{0}, maps_merged{0};
};

/// The mapper of local_mapping.py.
class LocalMapping {
 public:
  LocalMapping(Map& map, KeyFrameIndex& index, Counts& counts);

  /// Takes the keyframes that are done.
  std::function<void(KeyFrameId)> on_done;
  /// Called by the tracker; mapping of the keyframe begins with start().
  void insert_keyframe(KeyFrameId keyframe) { inserted_.push_back(keyframe); }
  /// From here on an IMU measures along. Its samples and states are those of a camera at rest, with
  /// so much noise that they weigh nothing.
  void use_imu();
  /// Samples up to a keyframe that was just inserted, and its state; called by the tracker.
  void add_inertial(KeyFrameId keyframe, double timestamp);
  void start();
  void reset();
  Worker worker;

 private:
  void process(KeyFrameId keyframe);

  Map& map_;
  KeyFrameIndex& index_;
  Counts& counts_;
  std::vector<KeyFrameId> inserted_;
  std::vector<MapPointId> recent_;
  std::unique_ptr<InertialKeyframes> inertial_;
  double sampled_until_ = 0;
};

/// The adjustment of full_adjustment.py.
class FullAdjustment {
 public:
  /// Of several threads each run gives other bytes.
  FullAdjustment(Map& map, LocalMapping& mapping, Counts& counts, int n_threads);

  /// Begins one; a running one is given up.
  void start();
  void cancel() { worker.reset(); }
  Worker worker;

 private:
  void process();

  Map& map_;
  LocalMapping& mapping_;
  Counts& counts_;
  const int n_threads_;
};

/// The loop closer of loop_closing.py. Beside the keyframes that words propose, it may try the one
/// that is known to show the same view a lap earlier, so that many loops are closed in little time.
class LoopClosing {
 public:
  LoopClosing(Map& map, KeyFrameIndex& index, LocalMapping& mapping, FullAdjustment& adjustment,
              Counts& counts, int frames_per_lap, std::uint64_t seed);

  void reset();
  Worker worker;

 private:
  void process(KeyFrameId keyframe);
  std::optional<Loop> find_loop(KeyFrameId keyframe);
  std::vector<KeyFrameId> a_lap_before(KeyFrameId keyframe) const;
  std::optional<Loop> choose(std::vector<Loop> loops) const;
  bool joins_maps(const Loop& loop) const;
  void close(const Loop& loop);
  void join(const Loop& loop);

  Map& map_;
  KeyFrameIndex& index_;
  LocalMapping& mapping_;
  FullAdjustment& adjustment_;
  Counts& counts_;
  const int frames_per_lap_;
  LoopVerificationOptions options_;
  LoopConsistency consistency_;
  std::int64_t next_search_ = 1;
  std::vector<KeyFrameId> members_;  // of the present map, as they arrived
};

/// Ends the process when the map violates an invariant.
void check_map(const Map& map, const char* when);

}  // namespace orbslam::driver
