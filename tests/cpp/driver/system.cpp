// SPDX-License-Identifier: BSD-3-Clause
#include "driver/system.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "map/content_hash.hpp"
#include "map/snapshot.hpp"

namespace orbslam::driver {

System::System(ImageRing& images, Counts& counts, Watchdog& watchdog, std::uint64_t seed)
    : images_(images),
      counts_(counts),
      watchdog_(watchdog),
      mapping_(map_, index_, counts),
      adjustment_(map_, mapping_, counts, 2),
      loop_closing_(map_, index_, mapping_, adjustment_, counts, images.size(), seed),
      tracker_(map_, index_, mapping_, counts),
      patient_(seed % 3 != 0),
      view_(static_cast<std::int64_t>(images.size() + seed % 1000)) {
  mapping_.use_imu();
  mapping_.on_done = [this](KeyFrameId keyframe) { loop_closing_.worker.submit(keyframe); };
  for (Worker* worker : map_workers()) worker->start();
}

std::vector<Worker*> System::map_workers() {
  return {&mapping_.worker, &loop_closing_.worker, &adjustment_.worker};
}

// ---- tracking -----------------------------------------------------------------------------------
void System::track_next() {
  if (shut_down_) return;
  if (reset_requested_) reset_now();
  switch_mode();
  {
    const Watchdog::Scope watched(watchdog_, "wait for mapping", 10);
    if (patient_) {
      mapping_.worker.wait_until_idle();
    } else {
      mapping_.worker.wait_until_waiting(1);
    }
  }
  if (map_requested_.exchange(false)) tracker_.begin_map();
  const Tracked outcome = tracker_.track(next_frame());
  if (outcome == Tracked::lost_early) {
    std::size_t n_maps;
    {
      const auto lock = map_.read_lock();
      n_maps = map_.maps().size();
    }
    if (n_maps > 1) {
      drop_map();
    } else {
      reset_requested_ = true;
    }
  } else if (tracker_.last()) {
    const std::lock_guard lock(trajectory_mutex_);
    recorder_.record(map_, *tracker_.last(), outcome != Tracked::ok);
  }
  mapping_.start();
}

std::shared_ptr<Frame> System::next_frame() {
  // In localization mode the camera turns back, so that it stays in the map.
  const std::int64_t step = tracker_.localization_only() ? -1 : 1;
  view_ = std::max<std::int64_t>(view_ + step, 0);
  if (jump_requested_.exchange(false)) {
    view_ = std::max<std::int64_t>(view_ - images_.size() / 4, 0);
    dark_frames_ = view_ % 3 == 0 ? 20 : 2;
  }
  const FrameId id = next_frame_++;
  const double timestamp = static_cast<double>(id) / 30;
  if (dark_frames_ > 0) {
    --dark_frames_;
    return images_.dark_frame(id, timestamp);
  }
  const double turns = static_cast<double>(view_) / images_.size();
  // The sensor's scale wanders by a hundredth, with a period that is not a lap.
  return images_.frame(view_, id, timestamp, 1 + 0.01 * std::sin(4.6 * turns));
}

// ---- control, in the tracking thread ------------------------------------------------------------
void System::reset_now() {
  const Watchdog::Scope watched(watchdog_, "reset");
  for (Worker* worker : map_workers()) worker->reset();
  mapping_.reset();
  loop_closing_.reset();
  {
    const std::lock_guard lock(trajectory_mutex_);
    recorder_.clear();
    index_.clear();
    const auto write = map_.write_lock();
    map_.clear();
  }
  tracker_.reset();
  next_frame_ = 0;
  reset_requested_ = false;
  ++counts_.resets;
}

/// The active map came to nothing; the others go on. Only this thread gives the workers work.
void System::drop_map() {
  // While one of them is held, keyframes of this map may wait for it; the next frame asks again.
  if (!mapping_.worker.wait_until_idle() || !loop_closing_.worker.wait_until_idle()) return;
  std::vector<KeyFrameId> died;
  {
    const std::lock_guard lock(trajectory_mutex_);
    recorder_.drop(map_, map_.active_map());
    const auto write = map_.write_lock();
    // A merge may have come first: what is active now is large.
    if (map_.n_keyframes_of(map_.active_map()) <= 5 && map_.maps().size() > 1) {
      died = map_.erase_map(map_.active_map());
    }
  }
  if (died.empty()) return;
  for (const KeyFrameId id : died) index_.erase(id);
  tracker_.go_back();
  check_map(map_, "after a map was dropped");
  ++counts_.maps_dropped;
}

void System::switch_mode() {
  std::size_t n_keyframes;
  {
    const auto lock = map_.read_lock();
    n_keyframes = map_.n_keyframes_of(map_.active_map());
  }
  // In a smaller map the camera, which turns back, would soon be outside.
  const bool wanted = localization_wanted_ && n_keyframes > 5;
  if (wanted == tracker_.localization_only()) return;
  const Watchdog::Scope watched(watchdog_, wanted ? "localization on" : "localization off");
  if (wanted) {
    const std::lock_guard lock(mode_mutex_);
    for (Worker* worker : map_workers()) mode_pauses_.emplace_back(*worker, false);
    for (Worker::Pause& pause : mode_pauses_) pause.wait();
    epoch_of_mode_ = map_.epoch();
    hash_of_mode_ = content_hash(map_);
  } else {
    release_mode();
  }
  tracker_.use_localization(wanted);
  ++counts_.mode_switches;
}

void System::release_mode() {
  const std::lock_guard lock(mode_mutex_);
  if (mode_pauses_.empty()) return;
  if (map_.epoch() == epoch_of_mode_ && content_hash(map_) != hash_of_mode_) {
    std::fprintf(stderr, "the map has changed in localization mode\n");
    std::abort();
  }
  mode_pauses_.clear();
}

// ---- control, from any thread -------------------------------------------------------------------
void System::optimize() {
  if (localization_wanted_ || shut_down_) return;
  adjustment_.start();
  if (!adjustment_.worker.wait_until_idle()) adjustment_.cancel();
}

void System::pause(int worker, bool brief, std::chrono::milliseconds duration) {
  Worker& held = *map_workers()[static_cast<std::size_t>(worker)];
  Worker::Pause pause(held, brief);
  {
    const Watchdog::Scope watched(watchdog_, "pause of " + held.name());
    pause.wait();
  }
  std::this_thread::sleep_for(duration);
  ++counts_.pauses;
}

void System::look() const {
  const MapSnapshot all = snapshot_map(map_);
  const ObservationSnapshot observations = snapshot_observations(map_);
  const EdgeSnapshot edges = snapshot_edges(map_);
  if (observations.offsets.size() != observations.ids.size() + 1 ||
      edges.a.size() != edges.b.size() || all.points.ids.size() != all.points.positions.size()) {
    std::abort();
  }
  {
    const std::lock_guard lock(trajectory_mutex_);
    recorder_.rebuild(map_);
    std::vector<MapIndex> maps;
    {
      const auto read = map_.read_lock();
      maps = map_.maps();
    }
    for (const MapIndex index : maps) recorder_.rebuild(map_, index);
  }
  ++counts_.snapshots;
}

void System::shutdown(bool drain) {
  const std::lock_guard lock(shutdown_mutex_);
  if (shut_down_.exchange(true)) return;
  const Watchdog::Scope watched(watchdog_, drain ? "drained shutdown" : "shutdown", drain ? 10 : 1);
  if (drain) release_mode();
  for (Worker* worker : map_workers()) worker->finish(drain && worker != &adjustment_.worker);
  check_map(map_, "after shutdown");
  ++counts_.shutdowns;
}

}  // namespace orbslam::driver
