// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <mutex>
#include <vector>

#include "driver/back_end.hpp"
#include "driver/images.hpp"
#include "driver/tracker.hpp"
#include "driver/watchdog.hpp"
#include "map/trajectory.hpp"

namespace orbslam::driver {

/// The system of system.py. One thread calls track_next(), any others the rest.
class System {
 public:
  System(ImageRing& images, Counts& counts, Watchdog& watchdog, std::uint64_t seed);
  ~System() { shutdown(false); }
  System(const System&) = delete;
  System& operator=(const System&) = delete;

  void track_next();

  // Requests, carried out before the next frame.
  void request_reset() { reset_requested_ = true; }
  void request_localization(bool wanted) { localization_wanted_ = wanted; }
  bool localization_wanted() const { return localization_wanted_; }
  /// The camera is carried back by a quarter of a lap, in the dark.
  void request_jump() { jump_requested_ = true; }
  /// Another map begins, wherever the camera is.
  void request_map() { map_requested_ = true; }

  /// Refines the whole map now; given up in localization mode.
  void optimize();
  /// Holds a worker still for a moment.
  void pause(int worker, bool brief, std::chrono::milliseconds duration);
  /// Looks at everything, as a viewer and an exporter do.
  void look() const;
  /// Idempotent; from any thread, also while others use the system.
  void shutdown(bool drain);

 private:
  std::vector<Worker*> map_workers();
  void reset_now();
  void drop_map();
  void switch_mode();
  void release_mode();
  std::shared_ptr<Frame> next_frame();

  ImageRing& images_;
  Counts& counts_;
  Watchdog& watchdog_;

  Map map_;
  KeyFrameIndex index_;
  LocalMapping mapping_;
  FullAdjustment adjustment_;
  LoopClosing loop_closing_;
  Tracker tracker_;

  mutable std::mutex trajectory_mutex_;
  TrajectoryRecorder recorder_;

  std::mutex mode_mutex_;
  std::vector<Worker::Pause> mode_pauses_;
  std::uint64_t epoch_of_mode_ = 0, hash_of_mode_ = 0;

  std::mutex shutdown_mutex_;
  std::atomic<bool> shut_down_{false}, reset_requested_{false}, localization_wanted_{false},
      jump_requested_{false}, map_requested_{false};
  /// The tracker waits until mapping is through with every keyframe, so that maps are good enough
  /// for loops to be believed; or it hurries mapping all the time.
  const bool patient_;
  FrameId next_frame_ = 0;
  std::int64_t view_ = 0;
  int dark_frames_ = 0;
};

}  // namespace orbslam::driver
